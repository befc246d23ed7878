/* ---- What stands before the network: moving average, resampling and scaling of the frames. ---- */

#if RAW_FRAMES > 0
struct raw_frames {
  double time_s[RAW_FRAMES];
  float values[RAW_FRAMES][SIGNALS];
  int32_t first, count;
};
static struct raw_frames raw; /* those that the moving average is over */
#endif

static float window[TIMESTEPS * SIGNALS];
static float ring[TIMESTEPS][SIGNALS]; /* sample j since the first frame stands at j modulo TIMESTEPS */
static float newest[SIGNALS];          /* the newest sample: the mean of its frames so far, scaled */
static double sum_of_frames[SIGNALS];  /* of these frames */
static int32_t summed;                 /* how many they are */
static int64_t samples;                /* since the first frame */
static double begin_s;                 /* time of the first frame */
static double newest_s;                /* and of the newest */

/* Whether sums keep their order, products are rounded before they are added, and what is no number is told from one.
   The bits are those of a PC only then; the values come from memory, so that this is how the rest was compiled. */
static int arithmetic_is_kept(void) {
  static const volatile float given[] = {100000000.0f, 1.0f, 1.000244140625f, 1.00048828125f};
  const float large = given[0], one = given[1], x = given[2], square = given[3];
  return (large + one) - large == 0.0f && x * x - square == 0.0f;
}

/* By its bits: a comparison may be taken for true. */
static int is_finite(double x) {
  uint64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return (bits >> 52 & 0x7ff) != 0x7ff;
}

void NAME_reset(void) {
  samples = 0;
#if RAW_FRAMES > 0
  raw.first = raw.count = 0;
#endif
}

#if RAW_FRAMES > 0
static void filter(double time_s, const float *values, float *filtered) {
  int32_t i, k, at;
  if (raw.count == RAW_FRAMES) raw.first = (raw.first + 1) % RAW_FRAMES, --raw.count;
  at = (raw.first + raw.count++) % RAW_FRAMES;
  raw.time_s[at] = time_s;
  memcpy(raw.values[at], values, sizeof raw.values[at]);
  while (raw.time_s[raw.first] < time_s - RAW_SPAN_S) raw.first = (raw.first + 1) % RAW_FRAMES, --raw.count;
  for (k = 0; k < SIGNALS; ++k) {
    double sum = 0;
    for (i = 0; i < raw.count; ++i) sum += (double)raw.values[(raw.first + i) % RAW_FRAMES][k];
    filtered[k] = (float)(sum / raw.count);
  }
}
#endif

/* The sample that a frame belongs to, so long after the first one. */
static int64_t sample_at(double since_begin_s) {
  const double periods = since_begin_s * RATE_HZ - 0.5 - CELL_SLACK;
  const int64_t whole = (int64_t)periods;
  return periods <= 0 ? 0 : whole + ((double)whole < periods);
}

/* 0 to 1, 1: pressed hard. */
static float scaled(float value) {
  const double v = (REST - (double)value) / SPAN;
  return v < 0 ? 0.0f : v > 1 ? 1.0f : (float)v;
}

int NAME_push_at(double time_s, const float values[SIGNALS]) {
  int64_t j;
  int32_t k;
#if RAW_FRAMES > 0
  float filtered[SIGNALS];
#endif
  if (!is_finite(time_s)) return 0;
  for (k = 0; k < SIGNALS; ++k)
    if (!is_finite((double)values[k])) return 0; /* the frame counts as lost */
  if (samples == 0 || time_s - newest_s > MAX_GAP_S || newest_s - time_s > MAX_GAP_S) {
    NAME_reset();
    if (!arithmetic_is_kept()) return 0;
  } else if (time_s <= newest_s) {
    return 0;
  }
  newest_s = time_s;
#if RAW_FRAMES > 0
  filter(time_s, values, filtered);
  values = filtered;
#endif
  if (TIMESTEPS == 1) samples = 0; /* each frame as it is */
  if (samples == 0) begin_s = time_s;
  j = sample_at(time_s - begin_s);
  if (samples <= j) {
    for (k = 0; k < SIGNALS; ++k) sum_of_frames[k] = 0;
    summed = 0;
  }
  for (; samples < j; ++samples) memcpy(ring[samples % TIMESTEPS], newest, sizeof newest); /* no frame */
  samples = j + 1;
  ++summed;
  for (k = 0; k < SIGNALS; ++k) {
    sum_of_frames[k] += (double)values[k];
    newest[k] = scaled((float)(sum_of_frames[k] / summed));
  }
  memcpy(ring[j % TIMESTEPS], newest, sizeof newest);
  return samples >= TIMESTEPS;
}

int NAME_push(const float values[SIGNALS]) { return NAME_push_at(samples == 0 ? 0 : newest_s + PERIOD_S, values); }

#if NORMALISED
/* The window's own rest and gain: of each signal the 5th percentile and the third largest sample, in steps
   of 1/256. */
static void normalise(void) {
  static uint16_t counts[256];
  float half_rest[SIGNALS], gain = LEAST_GAIN, factor;
  int32_t k, i, n, rest, top;
  for (k = 0; k < SIGNALS; ++k) {
    for (i = 0; i < 256; ++i) counts[i] = 0;
    for (i = k; i < TIMESTEPS * SIGNALS; i += SIGNALS) {
      float v = window[i] > 0.0f ? window[i] : 0.0f;
      v *= 256;
      ++counts[(int32_t)(v < 255.0f ? v : 255.0f)];
    }
    for (rest = 0, n = counts[0]; n <= TIMESTEPS / REST_SHARE; n += counts[++rest]) {
    }
    for (top = 255, n = counts[255]; n < TOP_RANK; n += counts[--top]) {
    }
    half_rest[k] = REST_REMOVED * ((float)rest * (1.0f / 256));
    if (gain < (float)top * (1.0f / 256) - half_rest[k]) gain = (float)top * (1.0f / 256) - half_rest[k];
  }
  factor = 1 / gain;
  for (i = 0; i < TIMESTEPS * SIGNALS; i += SIGNALS)
    for (k = 0; k < SIGNALS; ++k) {
      const float v = (window[i + k] - half_rest[k]) * factor;
      window[i + k] = v < 0.0f ? 0.0f : v > 1.0f ? 1.0f : v;
    }
}
#endif

int NAME_picture(float picture[PIXELS], float predicted_error[PIXELS]) {
  const int32_t oldest = (int32_t)(samples % TIMESTEPS);
  if (samples < TIMESTEPS) return 0;
  memcpy(window, ring[oldest], (size_t)(TIMESTEPS - oldest) * sizeof ring[0]);
  memcpy(window + (TIMESTEPS - oldest) * SIGNALS, ring[0], (size_t)oldest * sizeof ring[0]);
#if NORMALISED
  normalise();
#endif
  NAME_draw(window, picture, predicted_error);
  return 1;
}

/* SHA-256 of words that come with their lowest byte first. */
static const uint32_t rounds[64] = {
    0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u, 0x923f82a4u, 0xab1c5ed5u,
    0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu, 0x9bdc06a7u, 0xc19bf174u,
    0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu, 0x4a7484aau, 0x5cb0a9dcu, 0x76f988dau,
    0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u, 0xc6e00bf3u, 0xd5a79147u, 0x06ca6351u, 0x14292967u,
    0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu, 0x53380d13u, 0x650a7354u, 0x766a0abbu, 0x81c2c92eu, 0x92722c85u,
    0xa2bfe8a1u, 0xa81a664bu, 0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u, 0xf40e3585u, 0x106aa070u,
    0x19a4c116u, 0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au, 0x5b9cca4fu, 0x682e6ff3u,
    0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu, 0xbef9a3f7u, 0xc67178f2u,
};
struct sha256 {
  uint32_t sums[8], block[16], words;
};
static uint32_t turned(uint32_t x, int32_t n) { return x >> n | x << (32 - n); }
static void add_word(struct sha256 *hash, uint32_t word) {
  uint32_t s[8], *w = hash->block, one, two, i, k;
  w[hash->words++ % 16] = word << 24 | (word & 0xff00u) << 8 | (word >> 8 & 0xff00u) | word >> 24;
  if (hash->words % 16 != 0) return;
  memcpy(s, hash->sums, sizeof s);
  for (i = 0; i < 64; ++i) {
    if (i >= 16) {
      one = w[(i + 1) % 16], two = w[(i + 14) % 16];
      w[i % 16] += (turned(one, 7) ^ turned(one, 18) ^ one >> 3) + w[(i + 9) % 16] +
                   (turned(two, 17) ^ turned(two, 19) ^ two >> 10);
    }
    one = s[7] + (turned(s[4], 6) ^ turned(s[4], 11) ^ turned(s[4], 25)) + ((s[4] & s[5]) ^ (~s[4] & s[6])) +
          rounds[i] + w[i % 16];
    two = (turned(s[0], 2) ^ turned(s[0], 13) ^ turned(s[0], 22)) + ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
    for (k = 7; k > 0; --k) s[k] = s[k - 1];
    s[4] += one, s[0] = one + two;
  }
  for (i = 0; i < 8; ++i) hash->sums[i] += s[i];
}

static void add_values(struct sha256 *hash, const float *values, int32_t count) {
  int32_t i;
  for (i = 0; i < count; ++i) {
    uint32_t bits;
    memcpy(&bits, values + i, sizeof bits);
    add_word(hash, bits);
  }
}

/* The first 64 bits. */
static uint64_t hash_of(struct sha256 *hash) {
  const uint32_t bits = hash->words * 32;
  add_word(hash, 0x80);
  while (hash->words % 16 != 15) add_word(hash, 0);
  add_word(hash, bits << 24 | (bits & 0xff00u) << 8 | (bits >> 8 & 0xff00u) | bits >> 24);
  return (uint64_t)hash->sums[0] << 32 | hash->sums[1];
}

uint64_t NAME_self_test(float picture[PIXELS], float predicted_error[PIXELS]) {
  struct sha256 hash = {{0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                         0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u}, {0}, 0};
  uint32_t random = 1;
  int32_t i, k;
  float values[SIGNALS];
  NAME_reset();
  for (i = 0; i < SELF_TEST_FRAMES; ++i) {
    for (k = 0; k < SIGNALS; ++k) {
      random = random * 1664525u + 1013904223u;
      values[k] = (float)(REST - SPAN * ((double)(random >> 8) * (1.0 / 16777216)));
    }
    if (i == SELF_TEST_FRAMES / 2) { /* a frame that must be refused */
      const uint32_t not_a_number = 0x7fc00000u;
      memcpy(values, &not_a_number, sizeof not_a_number);
    }
    NAME_push_at(i * PERIOD_S, values);
  }
  if (!NAME_picture(picture, predicted_error)) return 0;
  NAME_reset();
  add_values(&hash, picture, PIXELS);
  if (PREDICTS_ERROR) add_values(&hash, predicted_error, PIXELS);
  return hash_of(&hash);
}
