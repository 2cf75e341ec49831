// What share of the light an order takes, and order 0 or any other summed over wavelengths.

uniform sampler2D shares;     // by phase between crest and trough, a row an order
uniform float phase_scale;    // nodes a radian
uniform sampler2D spectrum;   // weights of linear sRGB over the wavelength squared: a row a step
uniform float depth;

int highest_order() { return textureSize(shares, 0).y - 1; }

float share(int order, float w, float wavelength) {
  float at = min(TWO_PI / wavelength * w * depth * phase_scale, float(textureSize(shares, 0).x) - 1.001);
  int node = int(at);
  float low = texelFetch(shares, ivec2(node, order), 0).r, high = texelFetch(shares, ivec2(node + 1, order), 0).r;
  return mix(low, high, at - float(node));
}

// The sum over every so manieth wavelength of a row.
vec3 summed(Lobe l, float period, int order, int row, ivec2 ends, int every, float step_um) {
  vec3 sum = vec3(0);
  for (int i = ends.x / every * every; i <= ends.y; i += every) {
    float wavelength = wavelengths.x + float(i) * step_um;
    float square = per_um * wavelength * per_um * wavelength;
    float variance_u = square + l.more_u, variance_v = square + l.more_v;
    float away = l.u - float(order) * wavelength / period;
    float lobe = exp(-0.5 * (away * away / variance_u + l.v * l.v / variance_v)) * square
        / sqrt(variance_u * variance_v);
    sum += lobe * share(order, l.w, wavelength) * texelFetch(spectrum, ivec2(i, row), 0).rgb;
  }
  return sum * float(every);
}
