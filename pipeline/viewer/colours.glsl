// Integrals over the spectrum by Gaussians, drawn once into three textures: wavelengths across, logarithms of widths up.
// What an order's share is at three wavelengths, middle and to either side of it, is to be weighted with them: the
// integral of the parabola through the three.

uniform sampler2D spectrum;   // row 0: weights of linear sRGB
uniform vec2 colour_axis;     // first wavelength in um, nodes a um
uniform vec2 width_axis;      // logarithm of the first width in um, nodes a unit of it
uniform vec3 wavelengths;     // first, last, step of row 0, in um

layout(location = 0) out vec4 shorter;
layout(location = 1) out vec4 middle;   // and the middle wavelength in um
layout(location = 2) out vec4 longer;   // and how far the others are from it

const float FAR = 6.0;        // standard deviations after which nothing is left
const float UNSCALED = 0.55;  // wavelength in um whose weights diffraction leaves as they are
const float APART = 1.2;      // distance of the three wavelengths, over the standard deviation of what is seen

vec3 weight(int i) {
  float over = (wavelengths.x + float(i) * wavelengths.z) / UNSCALED;
  return over * over * texelFetch(spectrum, ivec2(i, 0), 0).rgb;
}

void main() {
  vec2 at = gl_FragCoord.xy - 0.5;
  float wavelength = colour_axis.x + at.x / colour_axis.y;
  float width = exp(width_axis.x + at.y / width_axis.y);
  float nearest = clamp(wavelength, wavelengths.x, wavelengths.y);
  float away = (nearest - wavelength) / width, least = 0.5 * away * away;
  int last = int(round((wavelengths.y - wavelengths.x) / wavelengths.z));
  float place = (nearest - wavelengths.x) / wavelengths.z, some = FAR * width / wavelengths.z + 1.0;
  int low = max(0, int(place - some)), high = min(last, int(place + some));
  // Relative to the brightest, so that the moments are known where hardly anything is left.
  float seen = 0.0, mean = 0.0, square = 0.0;
  for (int i = low; i <= high; i++) {
    float off = float(i) * wavelengths.z + wavelengths.x - wavelength;
    float one = exp(least - 0.5 * off * off / (width * width)) * dot(abs(weight(i)), vec3(1));
    seen += one;
    mean += one * off;
    square += one * off * off;
  }
  mean /= seen;
  float apart = APART * sqrt(max(square / seen - mean * mean, 1e-8));
  vec3 zeroth = vec3(0), first = vec3(0), second = vec3(0);
  for (int i = low; i <= high; i++) {
    float off = float(i) * wavelengths.z + wavelengths.x - wavelength, from = (off - mean) / apart;
    vec3 one = exp(-0.5 * off * off / (width * width)) * weight(i) / width;
    zeroth += one;
    first += one * from;
    second += one * from * from;
  }
  shorter = vec4(0.5 * (second - first), 1.0);
  middle = vec4(zeroth - second, wavelength + mean);
  longer = vec4(0.5 * (second + first), apart);
}
