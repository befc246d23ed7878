static int32_t line_of(const struct map *m) { return (m->width + 2 * m->margin_w) * m->channels; }
static int32_t first_of(const struct map *m) { return m->margin_h * line_of(m) + m->margin_w * m->channels; }
static uint8_t *bytes_of(const struct map *m) { return WORK + m->offset; }
static int16_t *numbers_of(const struct map *m) { return (int16_t *)(void *)(WORK + m->offset); }

static int32_t clip(int32_t v, int32_t low, int32_t high) { return v < low ? low : v > high ? high : v; }

/* Only the margin, not what lies inside. */
static void fill_margin(const struct map *m) {
  const int32_t line = line_of(m), lines = m->height + 2 * m->margin_h, side = m->margin_w * m->channels;
  int32_t i, k;
  for (i = 0; i < lines; ++i) {
    const int inside = i >= m->margin_h && i < m->height + m->margin_h;
    for (k = 0; k < line; ++k) {
      if (inside && k == side) k = line - side;
      if (k == line) break;
      if (m->bytes)
        bytes_of(m)[i * line + k] = m->zero;
      else
        numbers_of(m)[i * line + k] = 0;
    }
  }
}

/* sum[o] += x . w[o] for four outputs; w [length / 4][4 outputs][4]. */
static const uint8_t *dot4(const uint8_t *x, const uint8_t *w, int32_t length, int32_t sum[4]) {
  int32_t a = sum[0], b = sum[1], c = sum[2], d = sum[3];
  const uint8_t *const end = x + length;
#if defined(__ARM_FEATURE_DSP) && defined(__GNUC__)
  /* Two products an instruction: bytes 0 and 2 of a word are widened, then bytes 1 and 3. */
#define EVEN(to, from) __asm__("uxtb16 %0, %1" : "=r"(to) : "r"(from))
#define ODD(to, from) __asm__("uxtb16 %0, %1, ror #8" : "=r"(to) : "r"(from))
#define ADD_PRODUCTS(to, p, q) __asm__("smlad %0, %1, %2, %0" : "+r"(to) : "r"(p), "r"(q))
#define OUTPUT(to, at)                    \
  do {                                    \
    uint32_t word, w_even, w_odd;         \
    memcpy(&word, w + (at), sizeof word); \
    EVEN(w_even, word);                   \
    ODD(w_odd, word);                     \
    ADD_PRODUCTS(to, x_even, w_even);     \
    ADD_PRODUCTS(to, x_odd, w_odd);       \
  } while (0)
  for (; x != end; x += 4, w += 16) {
    uint32_t four, x_even, x_odd;
    memcpy(&four, x, sizeof four);
    EVEN(x_even, four);
    ODD(x_odd, four);
    OUTPUT(a, 0);
    OUTPUT(b, 4);
    OUTPUT(c, 8);
    OUTPUT(d, 12);
  }
#else
#define COLUMN(k) v = x[k], a += v * w[k], b += v * w[4 + (k)], c += v * w[8 + (k)], d += v * w[12 + (k)]
  for (; x != end; x += 4, w += 16) {
    int32_t v;
    COLUMN(0);
    COLUMN(1);
    COLUMN(2);
    COLUMN(3);
  }
#endif
  sum[0] = a, sum[1] = b, sum[2] = c, sum[3] = d;
  return w;
}

/* What the 128 in the weights adds to every sum of a pixel. */
static int32_t excess(const struct product *p, const uint8_t *x) {
  int32_t sum = 0, i, k;
  for (i = 0; i < p->segments; ++i)
    for (k = 0; k < p->length; k += 4) {
      const uint8_t *const four = x + p->segment[i] + k;
#if defined(__ARM_FEATURE_DSP) && defined(__GNUC__)
      uint32_t word;
      memcpy(&word, four, sizeof word);
      __asm__("usada8 %0, %1, %2, %0" : "+r"(sum) : "r"(word), "r"(0));
#else
      sum += four[0] + four[1] + four[2] + four[3];
#endif
    }
  return 128 * sum;
}

static inline int32_t result(int32_t sum, const struct outcome *q, int32_t slope) {
  const int32_t v = (sum * q->multiplier + q->offset) >> q->shift;
  return v < 0 && slope < 4096 ? (v * slope + 2048) >> 12 : v;
}

/* Of bytes. Weights are filled up to whole fours of outputs. */
static void product_of_bytes(const struct product *p, const struct map *x, const struct map *y) {
  const uint8_t *const from = bytes_of(x) + first_of(x);
  const int32_t to = first_of(y) + p->y_first, slope = p->slope, zero = y->zero, is_bytes = y->bytes;
  int32_t line, pixel, o, i;
  for (line = 0; line < p->height; ++line)
    for (pixel = 0; pixel < p->width; ++pixel) {
      const uint8_t *const at = from + line * p->x_line + pixel * p->x_pixel;
      const uint8_t *w = (const uint8_t *)p->weights;
      const struct outcome *q = p->outcomes;
      const int32_t place = to + line * p->y_line + pixel * p->y_pixel, less = excess(p, at);
      uint8_t *byte = bytes_of(y) + place;
      int16_t *number = numbers_of(y) + place;
      for (o = p->outputs; o > 0; o -= 4) {
        int32_t sum[4];
        sum[0] = sum[1] = sum[2] = sum[3] = -less;
        for (i = 0; i < p->segments; ++i) w = dot4(at + p->segment[i], w, p->length, sum);
        if (is_bytes)
          for (i = 0; i < 4 && i < o; ++i) *byte++ = (uint8_t)clip(result(sum[i], q++, slope) + zero, 0, 255);
        else
          for (i = 0; i < 4 && i < o; ++i) *number++ = (int16_t)clip(result(sum[i], q++, slope), -32768, 32767);
      }
    }
}

/* Of numbers; weights [outputs][segments * length]. */
static void product_of_numbers(const struct product *p, const struct map *x, const struct map *y) {
  const int16_t *const from = numbers_of(x) + first_of(x);
  int16_t *const to = numbers_of(y) + first_of(y) + p->y_first;
  int32_t line, pixel, o, i, k;
  for (line = 0; line < p->height; ++line)
    for (pixel = 0; pixel < p->width; ++pixel) {
      const int16_t *const at = from + line * p->x_line + pixel * p->x_pixel;
      const int8_t *w = (const int8_t *)p->weights;
      for (o = 0; o < p->outputs; ++o) {
        const struct outcome *const q = p->outcomes + o;
        int32_t sum = 0, v;
        for (i = 0; i < p->segments; ++i, w += p->length) {
          const int16_t *const run = at + p->segment[i];
          for (k = 0; k + 4 <= p->length; k += 4)
            sum += run[k] * w[k] + run[k + 1] * w[k + 1] + run[k + 2] * w[k + 2] + run[k + 3] * w[k + 3];
          for (; k < p->length; ++k) sum += run[k] * w[k];
        }
        {
          const int64_t scaled = ((int64_t)sum * q->multiplier + q->offset) >> q->shift;
          v = scaled < -32768 ? -32768 : scaled > 32767 ? 32767 : (int32_t)scaled;
        }
        if (v < 0 && p->slope != 4096) v = (v * p->slope + 2048) >> 12;
        to[line * p->y_line + pixel * p->y_pixel + o] = (int16_t)v;
      }
    }
}

/* y = x in another scale. The pointers walk: to[i] becomes an address (pass ivopts) in which GCC 12, at -O1 and -O2,
   sees no memory of others (pass pure-const), so that it took the function for pure and left out its calls. */
static void to_bytes(const struct map *x, const struct map *y, int32_t multiplier, int32_t offset, int32_t shift) {
  const int32_t n = x->width * x->channels;
  int32_t line, i;
  for (line = 0; line < x->height; ++line) {
    const int16_t *from = numbers_of(x) + first_of(x) + line * line_of(x);
    uint8_t *to = bytes_of(y) + first_of(y) + line * line_of(y);
    for (i = 0; i < n; ++i) *to++ = (uint8_t)clip(((*from++ * multiplier + offset) >> shift) + y->zero, 0, 255);
  }
}

/* From channel `at` of y on, what x holds, which has no margin. */
static void copy(const struct map *x, const struct map *y, int32_t at) {
  const int32_t row = y->width * y->channels, run = x->channels < row ? x->channels : row;
  int32_t line;
  for (line = 0; line < y->height; ++line)
    memcpy(numbers_of(y) + first_of(y) + line * line_of(y) + at, numbers_of(x) + line * run,
           (size_t)run * sizeof(int16_t));
}

static void mean(const struct map *x, const struct map *y) {
  const int32_t pixels = x->height * x->width;
  int32_t line, pixel, c;
  for (c = 0; c < x->channels; ++c) {
    int32_t sum = 0;
    for (line = 0; line < x->height; ++line)
      for (pixel = 0; pixel < x->width; ++pixel)
        sum += numbers_of(x)[first_of(x) + line * line_of(x) + pixel * x->channels + c];
    numbers_of(y)[c] = (int16_t)((sum < 0 ? sum - pixels / 2 : sum + pixels / 2) / pixels);
  }
}

/* 1 / (1 + e^-x) in separate multiplications and additions, so that its bits are those of a PC. */
static float sigmoid(float x) {
  const float t = x < 0 ? x : -x, limited = t < -87.0f ? -87.0f : t;
  const float shifted = limited * 1.44269504f + 12582912.0f, n = shifted - 12582912.0f;
  const float r = (limited - n * 0.693359375f) - n * -2.12194440e-4f;
  float p = 1.0f / 5040.0f, power, s;
  int32_t bits;
  p = p * r + 1.0f / 720.0f;
  p = p * r + 1.0f / 120.0f;
  p = p * r + 1.0f / 24.0f;
  p = p * r + 1.0f / 6.0f;
  p = p * r + 0.5f;
  p = p * r + 1.0f;
  p = p * r + 1.0f;
  memcpy(&bits, &shifted, sizeof bits);
  bits = (bits - 0x4B400000 + 127) * (1 << 23);
  memcpy(&power, &bits, sizeof power);
  p *= power;
  s = 1 / (1 + p);
  return x < 0 ? p * s : s;
}

/* In 4096ths. */
static void gates(const struct map *x, const struct map *y) {
  int32_t c;
  for (c = 0; c < x->channels; ++c)
    numbers_of(y)[c] = (int16_t)(sigmoid((float)numbers_of(x)[c] * NUMBER_STEP) * 4096.0f + 0.5f);
}

/* y = a + x * gate, gate of each channel in 4096ths; without gates a + x. */
static void gated_sum(const struct map *a, const struct map *x, const struct map *gate, const struct map *y) {
  int32_t line, pixel, c;
  for (line = 0; line < x->height; ++line)
    for (pixel = 0; pixel < x->width; ++pixel) {
      const int16_t *const b = numbers_of(a) + first_of(a) + line * line_of(a) + pixel * a->channels;
      const int16_t *const h = numbers_of(x) + first_of(x) + line * line_of(x) + pixel * x->channels;
      int16_t *const to = numbers_of(y) + first_of(y) + line * line_of(y) + pixel * y->channels;
      for (c = 0; c < x->channels; ++c) {
        const int32_t gated = gate ? (h[c] * numbers_of(gate)[c] + 2048) >> 12 : h[c];
        to[c] = (int16_t)clip(b[c] + gated, -32768, 32767);
      }
    }
}

/* y = of the window, for each pixel, runs of `run` values from `first` on, `apart` from one to the next; a pixel's first
   value is `step` behind that of the one before. */
static void take_input(const float *from, const struct map *y, int32_t first, int32_t run, int32_t apart, int32_t step,
                       int32_t multiplier, int32_t offset, int32_t shift) {
  int32_t line, pixel, k, i, end;
  for (line = 0; line < y->height; ++line) {
    int32_t to = first_of(y) + line * line_of(y);
    for (pixel = 0; pixel < y->width; ++pixel, from += step)
      for (k = 0; k < y->channels; k += run)
        for (i = first + k / run * apart, end = i + run; i < end; ++i, ++to) {
          float v = from[i] * (1 / NUMBER_STEP);
          int32_t number;
          v = v > -32768.0f ? v : -32768.0f;
          v = v < 32767.0f ? v : 32767.0f;
          number = (int32_t)(v + 32768.5f) - 32768;
          if (y->bytes)
            bytes_of(y)[to] = (uint8_t)clip(((number * multiplier + offset) >> shift) + y->zero, 0, 255);
          else
            numbers_of(y)[to] = (int16_t)number;
        }
  }
}

static void give(const struct map *x, float *to) {
  int32_t line, i;
  for (line = 0; line < x->height; ++line)
    for (i = 0; i < x->width * x->channels; ++i)
      *to++ = (float)numbers_of(x)[first_of(x) + line * line_of(x) + i] * NUMBER_STEP;
}
