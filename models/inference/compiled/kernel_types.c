/* ---- The network's arithmetic: whole numbers, with the same bits on every processor. C99 and C++. ---- */

/* A map lies in the work area: [height][width][channels] with a margin around whose value stands for 0.
   Bytes stand for (byte - zero) steps; numbers of 16 bits for steps of NUMBER_STEP. */
struct map {
  int32_t offset;
  int16_t height, width, channels, margin_h, margin_w;
  uint8_t bytes, zero;
};

/* What becomes of the sum of one output: (sum * multiplier + offset) >> shift, in steps of the next map. */
struct outcome {
  int32_t offset;
  uint16_t multiplier, shift;
};

/* A convolution, a linear layer, or every second pixel of a transposed convolution: for each pixel of y, `segments`
   runs of `length` neighbours of x meet the weights. Distances are counted in elements of the maps. */
struct product {
  const void *weights; /* of bytes uint8_t, with 128 added: small parts load them faster so; of numbers int8_t */
  const struct outcome *outcomes;
  int16_t height, width, outputs, length, segments, slope; /* negative results are multiplied by slope / 4096 */
  int32_t x_line, x_pixel, y_line, y_pixel, y_first;
  int32_t segment[4];
};
