// Order m sends lambda_m = a u / m to the eye. Its integral over the spectrum is one around that wavelength, by a
// Gaussian of width a sqrt(variance) / m: looked up, times what the order does at three wavelengths within it.

uniform sampler2D shorter, middle, longer;  // over the width, by wavelength and width; see colours.glsl
uniform vec2 colour_axis;     // first wavelength in um, nodes a um
uniform vec2 width_axis;      // logarithm of the first width in um, nodes a unit of it
uniform float coarse_step;    // of row 1 of the spectrum, in um

const float MOST_TURN = 0.016; // um^2: half a radian of phase between two of the three wavelengths
const float WIDEST = 0.08;     // um, standard deviation of all light that is seen
const float UNSCALED = 0.55;  // wavelength in um whose weights diffraction leaves as they are

float order_at(Lobe l, int m, float wavelength) {
  float square = per_um * wavelength * per_um * wavelength, variance_v = square + l.more_v;
  return share(m, l.w, wavelength) * exp(-0.5 * l.v * l.v / variance_v) / sqrt((square + l.more_u) * variance_v);
}

// Where the Gaussian's middle lies and how wide it is. The spread grows with the wavelength, which makes the lobe skew,
// to first order as if it stood at a longer wavelength.
vec2 gaussian_of(Lobe l, float period, int m) {
  float wavelength = l.u * period / float(m), seen = clamp(abs(wavelength), wavelengths.x, wavelengths.y);
  float square = per_um * seen * per_um * seen, stretch = period / float(m);
  float skew = 3.0 * square * stretch * stretch / seen;
  return vec2(wavelength + skew, stretch * sqrt(square + l.more_u));
}

vec3 order_colour(Lobe l, int m, float wavelength, float width) {
  vec2 size = vec2(textureSize(middle, 0));
  vec2 node = vec2((wavelength - colour_axis.x) * colour_axis.y, (log(width) - width_axis.x) * width_axis.y);
  vec2 inside = clamp(node, vec2(0), size - 1.0), at = (inside + 0.5) / size;
  vec4 mid = texture(middle, at), far = texture(longer, at);
  vec3 colour = order_at(l, m, mid.a - far.a) * texture(shorter, at).rgb + order_at(l, m, mid.a) * mid.rgb
      + order_at(l, m, mid.a + far.a) * far.rgb;
  float fall = 1.0;
  if (inside.x != node.x) {  // beyond the table's end, go on as a Gaussian
    vec2 away = (vec2(colour_axis.x + inside.x / colour_axis.y, wavelength) - mid.a) / width;
    fall = exp(0.5 * (away.x * away.x - away.y * away.y));
  }
  return colour * (width * fall * per_um * UNSCALED * per_um * UNSCALED);
}

// Order 0, and lobes so wide that an order's share turns too much within them, are summed over few wavelengths. The
// orders are counted down, because the lowest are the widest.
vec3 orders(Lobe l, float period, float reach, bool zeroth) {
  int first = max(1, int(ceil((l.u - reach) * period / wavelengths.y)));
  int m = min(highest_order(), int((l.u + reach) * period / wavelengths.x));
  vec3 sum = vec3(0);
  for (; m >= first; m--) {
    vec2 gaussian = gaussian_of(l, period, m);
    if (l.w * depth * min(gaussian.y, WIDEST) > MOST_TURN) break;
    sum += order_colour(l, m, gaussian.x, gaussian.y);
  }
  int count = int(round((wavelengths.y - wavelengths.x) / coarse_step));
  for (int wide = zeroth ? 0 : first; wide <= max(m, 0); wide = max(wide + 1, first))
    sum += summed(l, period, wide, 1, ivec2(0, count), 1, coarse_step);
  return sum;
}
