/* ---- What stands before the network: moving average, resampling and scaling of the frames. ---- */

#if RAW_FRAMES > 0
static struct {
  double time_s[RAW_FRAMES];
  float values[RAW_FRAMES][SIGNALS];
  int32_t first, count;
} raw; /* those that the moving average is over */
#endif

static float window[TIMESTEPS * SIGNALS];
static float ring[TIMESTEPS][SIGNALS]; /* sample j since the first frame stands at j modulo TIMESTEPS */
static float newest[SIGNALS];          /* the newest sample: the mean of its frames so far, scaled */
static double sum[SIGNALS];            /* of these frames */
static int32_t summed;                 /* how many they are */
static int64_t samples;                /* since the first frame */
static double begin_s, newest_s;       /* times of the first and the newest frame */

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
  if (!(time_s - time_s == 0)) return 0;
  for (k = 0; k < SIGNALS; ++k)
    if (!(values[k] - values[k] == 0)) return 0; /* not a number: the frame counts as lost */
  if (samples == 0 || time_s - newest_s > MAX_GAP_S || newest_s - time_s > MAX_GAP_S)
    NAME_reset();
  else if (time_s <= newest_s)
    return 0;
  newest_s = time_s;
#if RAW_FRAMES > 0
  filter(time_s, values, filtered);
  values = filtered;
#endif
  if (TIMESTEPS == 1) samples = 0; /* each frame as it is */
  if (samples == 0) begin_s = time_s;
  j = sample_at(time_s - begin_s);
  if (samples <= j) {
    for (k = 0; k < SIGNALS; ++k) sum[k] = 0;
    summed = 0;
  }
  for (; samples < j; ++samples) memcpy(ring[samples % TIMESTEPS], newest, sizeof newest); /* no frame */
  samples = j + 1;
  ++summed;
  for (k = 0; k < SIGNALS; ++k) {
    sum[k] += (double)values[k];
    newest[k] = scaled((float)(sum[k] / summed));
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
