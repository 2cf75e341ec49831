// What share of the light an order takes, and order 0 or any other summed over wavelengths.

uniform sampler2D shares;     // by phase between crest and trough, a row an order
uniform float phase_scale;    // nodes a radian
uniform sampler2D spectrum;   // weights of linear sRGB: row 0 at the fine step, row 1 at the coarse one
uniform float depth;

int highest_order() { return textureSize(shares, 0).y - 1; }

float share(int order, float w, float wavelength) {
  float at = min(TWO_PI / wavelength * w * depth * phase_scale, float(textureSize(shares, 0).x) - 1.001);
  int node = int(at);
  float low = texelFetch(shares, ivec2(node, order), 0).r, high = texelFetch(shares, ivec2(node + 1, order), 0).r;
  return mix(low, high, at - float(node));
}

vec3 summed(Lobe l, float period, int order, int row, int low, int high, float step_um) {
  vec3 sum = vec3(0);
  for (int i = low; i <= high; i++) {
    float wavelength = wavelengths.x + float(i) * step_um;
    float square = per_um * wavelength * per_um * wavelength;
    float variance_u = square + l.more_u, variance_v = square + l.more_v;
    float away = l.u - float(order) * wavelength / period;
    float lobe = exp(-0.5 * (away * away / variance_u + l.v * l.v / variance_v)) * square
        / sqrt(variance_u * variance_v);
    sum += lobe * share(order, l.w, wavelength) * texelFetch(spectrum, ivec2(i, row), 0).rgb;
  }
  return sum;
}
