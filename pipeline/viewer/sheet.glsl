// Which grating a point of the picture shows, and where its half vector lies in the grating's frame; mm, y up.

uniform usampler2D maps;      // orientation and period as codes from 1; 0: no grating
uniform vec3 coding;          // radians of a step, um of the first code, um of a step
uniform float pixel_mm;
uniform vec2 tiles;           // along x and y
uniform mat3 to_sheet;        // from (column, row, 1) to homogeneous (x, y, 1)
uniform vec3 eye, light;
uniform float light_sigma;
uniform float period_scale;
uniform float inverse_reflectance;  // 1 / that at normal incidence; 1: a mirror
uniform float per_um;         // spread of an order through the coherence window, over the wavelength
uniform vec3 wavelengths;     // first, last, step, in um

const float REACH = 4.0;      // standard deviations beyond which a lobe counts as dark
const float TWO_PI = 6.283185307179586;

struct Place { vec2 mm; vec2 texel; float scale; };
struct Lobe { float u, v, w, more_u, more_v, gain; };

Place place_of(vec2 pixel) {
  vec3 at = to_sheet * vec3(pixel, 1.0);
  vec2 mm = at.xy / at.z;
  vec2 size = vec2(textureSize(maps, 0)) * tiles;
  return Place(mm, vec2(mm.x, -mm.y) / pixel_mm + 0.5 * size, at.z);
}

bool on_sheet(Place p) {
  vec2 size = vec2(textureSize(maps, 0)) * tiles;
  return p.scale > 0.0 && all(greaterThanEqual(p.texel, vec2(0))) && all(lessThan(p.texel, size));
}

// Orientation in radians and period in um; a period of 0 where nothing diffracts.
vec2 grating_at(Place p) {
  vec2 size = vec2(textureSize(maps, 0));
  ivec2 within = ivec2(p.texel - floor(p.texel / size) * size);
  uvec2 code = texelFetch(maps, clamp(within, ivec2(0), textureSize(maps, 0) - 1), 0).xy;
  if (code.x == 0u || code.y == 0u) return vec2(0);
  return vec2(float(code.x - 1u) * coding.x, (coding.y + float(code.y - 1u) * coding.z) * period_scale);
}

// The half vector's change where the picture moves by a step of ``mm`` on the sheet.
vec3 change(vec2 mm, vec3 to_light, float light_mm, vec3 to_eye, float eye_mm) {
  float by_light = dot(to_light.xy, mm) / light_mm, by_eye = dot(to_eye.xy, mm) / eye_mm;
  return to_light * by_light + to_eye * by_eye - vec3(mm, 0) * (1.0 / light_mm + 1.0 / eye_mm);
}

// ``part``: side of the area, in pixels, over which lobes are averaged as a Gaussian of the variance of a box.
Lobe lobe_at(Place p, float theta, float part) {
  vec3 to_light = light - vec3(p.mm, 0), to_eye = eye - vec3(p.mm, 0);
  float light_mm = length(to_light), eye_mm = length(to_eye);
  to_light /= light_mm;
  to_eye /= eye_mm;
  vec3 h = to_light + to_eye;
  vec2 tangent = vec2(cos(theta), sin(theta)), across = vec2(-tangent.y, tangent.x);
  float size = light_sigma / light_mm;
  vec2 along = vec2(dot(to_light.xy, tangent), dot(to_light.xy, across));
  vec2 more = size * size * (1.0 - along * along);
  for (int side = 0; side < 2 && part > 0.0; side++) {
    vec2 mm = part * (to_sheet[side].xy - p.mm * to_sheet[side].z) / p.scale;
    vec3 d = change(mm, to_light, light_mm, to_eye, eye_mm);
    vec2 moved = vec2(dot(d.xy, tangent), dot(d.xy, across));
    more += moved * moved / 12.0;
  }
  float between = dot(to_light, to_eye);
  float bend = 1.0 - sqrt(max(0.5 * (1.0 + between), 0.0));
  float fresnel = 1.0 + (inverse_reflectance - 1.0) * pow(max(bend, 0.0), 5.0);
  float spread = 500.0 / light_mm;
  float gain = fresnel * (1.0 + between) * (1.0 + between) / (to_eye.z * h.z * h.z) * spread * spread;
  bool lit = to_light.z > 0.0 && to_eye.z > 0.0;
  return Lobe(abs(dot(h.xy, tangent)), dot(h.xy, across), h.z, more.x, more.y, lit ? gain : 0.0);
}

// How far along u an order's middle may lie to be seen; negative where none is.
float reach_of(Lobe l) {
  float widest = per_um * wavelengths.y * per_um * wavelengths.y;
  float within = REACH * REACH * (widest + l.more_u);
  float left = within - l.v * l.v * (widest + l.more_u) / (widest + l.more_v);
  return left < 0.0 ? -1.0 : sqrt(left);
}
