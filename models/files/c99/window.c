/* ---- What stands before the network: moving average, resampling and scaling of the frames. ---- */

static struct {
  double time_s[HISTORY_FRAMES];
  float values[HISTORY_FRAMES][SIGNALS];
  int32_t first, count;
} history; /* the filtered frames */

#if RAW_FRAMES > 0
static struct {
  double time_s[RAW_FRAMES];
  float values[RAW_FRAMES][SIGNALS];
  int32_t first, count;
} raw; /* those that the moving average is over */
#endif

static float window[TIMESTEPS * SIGNALS];
static double run_begin_s, newest_s;

static int32_t floor_of(double x) {
  const int32_t whole = (int32_t)x;
  return whole - (x < (double)whole);
}

static const float *frame(int32_t i) { return history.values[(history.first + i) % HISTORY_FRAMES]; }
static double time_of(int32_t i) { return history.time_s[(history.first + i) % HISTORY_FRAMES]; }

/* The mean over `count` frames, summed in double precision in their order. */
static void mean_of(int32_t from, int32_t count, float *mean_value) {
  int32_t k, i;
  for (k = 0; k < SIGNALS; ++k) {
    double sum = 0;
    if (count == 1) {
      mean_value[k] = frame(from)[k];
      continue;
    }
    for (i = from; i < from + count; ++i) sum += (double)frame(i)[k];
    mean_value[k] = (float)(sum / count);
  }
}

void NAME_reset(void) {
  history.first = history.count = 0;
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

int NAME_push_at(double time_s, const float values[SIGNALS]) {
  int32_t k, at;
  if (!(time_s - time_s == 0)) return 0;
  for (k = 0; k < SIGNALS; ++k)
    if (!(values[k] - values[k] == 0)) return 0; /* not a number: the frame counts as lost */
  if (history.count == 0 || time_s - newest_s > MAX_GAP_S || newest_s - time_s > MAX_GAP_S) {
    NAME_reset();
    run_begin_s = time_s;
  } else if (time_s <= newest_s) {
    return 0;
  }
  if (history.count == HISTORY_FRAMES) history.first = (history.first + 1) % HISTORY_FRAMES, --history.count;
  at = (history.first + history.count++) % HISTORY_FRAMES;
  history.time_s[at] = newest_s = time_s;
#if RAW_FRAMES > 0
  filter(time_s, values, history.values[at]);
#else
  memcpy(history.values[at], values, sizeof history.values[at]);
#endif
  while (history.time_s[history.first] < time_s - HISTORY_SPAN_S)
    history.first = (history.first + 1) % HISTORY_FRAMES, --history.count;
  return (newest_s + HALF_PERIOD_S - run_begin_s) * RATE_HZ >= (double)TIMESTEPS - 0.5 - CELL_SLACK;
}

int NAME_push(const float values[SIGNALS]) {
  return NAME_push_at(history.count == 0 ? 0 : newest_s + PERIOD_S, values);
}

/* 0 to 1, 1: pressed hard. */
static void scale(float *values) {
  int32_t k;
  for (k = 0; k < SIGNALS; ++k) {
    const double v = (REST - (double)values[k]) / SPAN;
    values[k] = v < 0 ? 0.0f : v > 1 ? 1.0f : (float)v;
  }
}

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

/* The sample of a frame, counted back from the window's end; negative: later than the window. */
static int32_t sample_of(int32_t i, double end_s) { return floor_of((end_s - time_of(i)) * RATE_HZ + CELL_SLACK); }

int NAME_picture(float picture[PIXELS], float predicted_error[PIXELS]) {
  const double end_s = newest_s + HALF_PERIOD_S;
  float held[SIGNALS] = {0};
  int32_t low = 0, high = history.count, k;
  if (history.count == 0 || (end_s - run_begin_s) * RATE_HZ < (double)TIMESTEPS - 0.5 - CELL_SLACK) return 0;
  while (low < high) { /* the first frame of the window */
    const int32_t middle = (low + high) / 2;
    if (sample_of(middle, end_s) >= TIMESTEPS)
      low = middle + 1;
    else
      high = middle;
  }
  if (low != 0 && (low == history.count || sample_of(low, end_s) < TIMESTEPS - 1)) {
    /* The oldest sample has no frames: it repeats the last one before the window. */
    const int32_t before = sample_of(low - 1, end_s);
    while (low != 0 && sample_of(low - 1, end_s) == before) --low;
  }
  k = low < history.count ? sample_of(low, end_s) : 0;
  for (k = k < TIMESTEPS - 1 ? TIMESTEPS - 1 : k; k >= 0; --k) {
    const int32_t begin = low;
    while (low != history.count && sample_of(low, end_s) == k) ++low;
    if (low != begin) {
      mean_of(begin, low - begin, held);
      scale(held);
    }
    if (k < TIMESTEPS) memcpy(window + (TIMESTEPS - 1 - k) * SIGNALS, held, sizeof held);
  }
#if NORMALISED
  normalise();
#endif
  NAME_draw(window, picture, predicted_error);
  return 1;
}
