// The picture: the mean of some points of a pixel, linear or encoded for a display; beside the sheet it is transparent.

uniform float rows;           // of the picture
uniform int samples;          // along each side of a pixel
uniform float pixel_part;     // side of the area that a sample stands for, in pixels; 0: a point
uniform float exposure;
uniform bool encoded;
uniform float lines_from;     // pixels of a dot from which its orientation is drawn

out vec4 fragment;

vec3 srgb(vec3 linear) {
  vec3 c = clamp(linear, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

// All orders; the negative ones are those of the half vector's mirror image.
vec3 shine(Lobe l, float period) {
  float reach = reach_of(l);
  if (reach < 0.0) return vec3(0);
  int sides = (reach - l.u) * period > wavelengths.x ? 2 : 1;
  vec3 sum = vec3(0);
  for (int side = 0; side < sides; side++) {
    sum += orders(l, period, reach, side == 0 && l.u <= reach);
    l.u = -l.u;
  }
  return sum;
}

// A line through the middle of a dot, along its grating's tangent, and faintly where the next dot begins.
float drawn(Place p, float theta, float dot_px) {
  vec2 from = fract(p.texel) - 0.5, tangent = vec2(cos(theta), -sin(theta));
  float along = abs(dot(from, tangent)), across = abs(dot(from, vec2(-tangent.y, tangent.x)));
  float beside = max(across * dot_px - min(0.025 * dot_px, 1.5), (along - 0.33) * dot_px);
  float edge = (0.5 - max(abs(from.x), abs(from.y))) * dot_px;
  return max(clamp(0.5 - beside, 0.0, 1.0), 0.2 * clamp(1.0 - edge, 0.0, 1.0))
      * smoothstep(lines_from, 1.5 * lines_from, dot_px);
}

void main() {
  vec2 pixel = vec2(gl_FragCoord.x, rows - gl_FragCoord.y) - 0.5;
  vec3 sum = vec3(0);
  float covered = 0.0;
  for (int k = 0; k < samples * samples; k++) {
    vec2 offset = (vec2(k % samples, k / samples) + 0.5) / float(samples) - 0.5;
    Place p = place_of(pixel + offset);
    if (!on_sheet(p)) continue;
    covered += 1.0;
    vec2 grating = grating_at(p);
    if (grating.y <= 0.0) continue;
    Lobe l = lobe_at(p, grating.x, pixel_part);
    if (l.gain > 0.0) sum += l.gain * shine(l, grating.y);
  }
  float count = float(samples * samples);
  vec3 linear = exposure * sum / count;
  if (!encoded) {
    fragment = vec4(linear, covered / count);
    return;
  }
  vec3 shown = srgb(linear);
  Place p = place_of(pixel);
  if (lines_from > 0.0 && on_sheet(p)) {
    vec2 grating = grating_at(p);
    float dot_px = pixel_mm * p.scale / length(to_sheet[0].xy - p.mm * to_sheet[0].z);
    if (dot_px > lines_from && grating.y > 0.0) {
      float bright = dot(shown, vec3(0.2126, 0.7152, 0.0722));
      shown = mix(shown, vec3(bright > 0.45 ? 0.0 : 0.85), 0.8 * drawn(p, grating.x, dot_px));
    }
  }
  fragment = vec4(shown, 1.0) * covered / count;
}
