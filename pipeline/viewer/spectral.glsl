// Every order summed over all wavelengths, as the reference in Python does.

vec3 orders(Lobe l, float period, float reach, bool zeroth) {
  int last = int(round((wavelengths.y - wavelengths.x) / wavelengths.z));
  vec3 sum = zeroth ? summed(l, period, 0, 0, 0, last, wavelengths.z) : vec3(0);
  for (int m = 1; m <= highest_order(); m++) {
    float low = (l.u - reach) * period / float(m), high = (l.u + reach) * period / float(m);
    if (high < wavelengths.x) break;
    if (low > wavelengths.y) continue;
    int from = max(0, int((low - wavelengths.x) / wavelengths.z));
    int to = min(last, int((high - wavelengths.x) / wavelengths.z) + 1);
    sum += summed(l, period, m, 0, from, to, wavelengths.z);
  }
  return sum;
}
