// Every order summed over the wavelengths that it sends to the eye, as the reference in Python does.

const float MOST_STEP = 0.003;  // um
const float SAMPLED = 0.9;      // steps in a lobe's standard deviation, at least: aliasing of 1e-7

vec3 orders(Lobe l, float period, float reach, bool zeroth) {
  int last = int(round((wavelengths.y - wavelengths.x) / wavelengths.z)), most = int(MOST_STEP / wavelengths.z + 0.5);
  float narrowest = per_um * wavelengths.x;
  vec3 sum = zeroth ? summed(l, period, 0, 0, ivec2(0, last), most, wavelengths.z) : vec3(0);
  for (int m = 1; m <= highest_order(); m++) {
    vec2 ends = vec2(l.u - reach, l.u + reach) * period / float(m);
    if (ends.y < wavelengths.x) break;
    if (ends.x > wavelengths.y) continue;
    ivec2 at = ivec2((clamp(ends, wavelengths.x, wavelengths.y) - wavelengths.x) / wavelengths.z + vec2(0, 1));
    float width = sqrt(narrowest * narrowest + l.more_u) * period / float(m);
    int every = clamp(int(width / SAMPLED / wavelengths.z), 1, most);
    sum += summed(l, period, m, 0, min(at, last), every, wavelengths.z);
  }
  return sum;
}
