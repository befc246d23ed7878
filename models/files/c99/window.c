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

/* FNV-1a over the bits, lowest byte first. */
static uint64_t hash_of(uint64_t hash, const float *values, int32_t count) {
  int32_t i, k;
  for (i = 0; i < count; ++i) {
    uint32_t bits;
    memcpy(&bits, values + i, sizeof bits);
    for (k = 0; k < 4; ++k, bits >>= 8) hash = (hash ^ (bits & 255)) * 1099511628211ull;
  }
  return hash;
}

uint64_t NAME_self_test(float picture[PIXELS], float predicted_error[PIXELS]) {
  uint64_t hash = 14695981039346656037ull;
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
  hash = hash_of(hash, picture, PIXELS);
  return PREDICTS_ERROR ? hash_of(hash, predicted_error, PIXELS) : hash;
}
