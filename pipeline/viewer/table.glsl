// Order m sends lambda_m = a u / m to the eye. Its integral over the spectrum is one around that wavelength, by a
// Gaussian of width a sqrt(variance) / m: looked up, times what the order does at three wavelengths within it.

uniform sampler2D shorter, middle, longer;  // over the width, by wavelength and width; see colours.glsl
uniform vec2 colour_axis;     // first wavelength in um, nodes a um
uniform vec2 width_axis;      // logarithm of the first width in um, nodes a unit of it
uniform float coarse_step;    // of row 1 of the spectrum, in um

const float MOST_TURN = 0.5;   // radians by which the phase depth may change from one to the next of them
const float UNSCALED = 0.55;  // wavelength in um whose weights diffraction leaves as they are

float order_at(Lobe l, int m, float wavelength) {
  float square = per_um * wavelength * per_um * wavelength, variance_v = square + l.more_v;
  return share(m, l.w, wavelength) * exp(-0.5 * l.v * l.v / variance_v) / sqrt((square + l.more_u) * variance_v);
}

// The sum over few wavelengths, for order 0 and for lobes so wide that they are smooth.
vec3 coarse_sum(Lobe l, float period, int m) {
  int count = int(round((wavelengths.y - wavelengths.x) / coarse_step));
  return summed(l, period, m, 1, 0, count, coarse_step);
}

vec3 order_colour(Lobe l, float period, int m) {
  float wavelength = l.u * period / float(m);
  float spread = per_um * clamp(wavelength, wavelengths.x, wavelengths.y);
  float width = period * sqrt(spread * spread + l.more_u) / float(m);
  vec2 size = vec2(textureSize(middle, 0));
  vec2 node = vec2((wavelength - colour_axis.x) * colour_axis.y, (log(width) - width_axis.x) * width_axis.y);
  vec2 inside = clamp(node, vec2(0), size - 1.0), at = (inside + 0.5) / size;
  vec4 mid = texture(middle, at), far = texture(longer, at);
  float turn = TWO_PI * l.w * depth * far.a / (mid.a * mid.a);
  if (turn > MOST_TURN) return coarse_sum(l, period, m);
  vec3 colour = order_at(l, m, mid.a - far.a) * texture(shorter, at).rgb + order_at(l, m, mid.a) * mid.rgb
      + order_at(l, m, mid.a + far.a) * far.rgb;
  float fall = 1.0;
  if (inside.x != node.x) {  // beyond the table's end, go on as a Gaussian
    vec2 away = (vec2(colour_axis.x + inside.x / colour_axis.y, wavelength) - mid.a) / width;
    fall = exp(0.5 * (away.x * away.x - away.y * away.y));
  }
  return colour * (width * fall * per_um * UNSCALED * per_um * UNSCALED);
}

vec3 shine(Lobe l, float period) {
  float reach = reach_of(l);
  if (reach < 0.0) return vec3(0);
  int first = max(1, int(ceil((l.u - reach) * period / wavelengths.y)));
  int last = min(highest_order(), int((l.u + reach) * period / wavelengths.x));
  vec3 sum = l.u > reach ? vec3(0) : coarse_sum(l, period, 0);
  for (int m = first; m <= last; m++) sum += order_colour(l, period, m);
  return sum;
}
