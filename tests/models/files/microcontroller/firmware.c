/* Draws what the host gave it and says the hash of all pictures, under qemu with semihosting. Reads "input": 0 and a
   count of windows, or 1 and a count of frames, each a time and its values. */
#include <string.h>

#include "finger.h"

static int32_t host(int32_t operation, const void *arguments) {
  register int32_t r0 __asm__("r0") = operation;
  register const void *r1 __asm__("r1") = arguments;
  __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

static int32_t input;

static void open_input(void) {
  static const char name[] = "input";
  const int32_t arguments[] = {(int32_t)name, 1 /* rb */, (int32_t)(sizeof name - 1)};
  input = host(0x01, arguments);
}

static int read_all(void *to, int32_t size) {
  const int32_t arguments[] = {input, (int32_t)to, size};
  return host(0x06, arguments) == 0;
}

static void say(const char *name, uint64_t value) {
  char line[64] = {0}, digits[24];
  int n = 0, i = 0;
  while (name[n] != 0) line[n] = name[n], ++n;
  line[n++] = ' ';
  do digits[i++] = (char)('0' + value % 10);
  while ((value /= 10) > 0);
  while (i > 0) line[n++] = digits[--i];
  line[n++] = '\n';
  host(0x04, line);
}

/* FNV-1a over the bits. */
static uint64_t hash = 14695981039346656037ull;
static void add(const float *values) {
  int i, k;
  for (i = 0; i < FINGER_HEIGHT * FINGER_WIDTH; ++i) {
    uint32_t bits;
    memcpy(&bits, values + i, sizeof bits);
    for (k = 0; k < 4; ++k, bits >>= 8) hash = (hash ^ (bits & 255)) * 1099511628211ull;
  }
}

/* With -icount shift=0 an instruction takes a nanosecond, and the timer counts 25 MHz down. */
#define TIMER_CONTROL (*(volatile uint32_t *)0xE000E010)
#define TIMER_RELOAD (*(volatile uint32_t *)0xE000E014)
#define TIMER_NOW (*(volatile uint32_t *)0xE000E018)
static uint64_t instructions(uint32_t since) { return (uint64_t)((since - TIMER_NOW) & 0xFFFFFF) * 40; }

static float window[FINGER_TIMESTEPS * FINGER_SIGNALS];
static float picture[FINGER_HEIGHT * FINGER_WIDTH], predicted_error[FINGER_HEIGHT * FINGER_WIDTH];

void run(void) {
  int32_t header[2], i;
  uint64_t most = 0, pictures = 0;
  TIMER_RELOAD = 0xFFFFFF;
  TIMER_NOW = 0;
  TIMER_CONTROL = 5;
  open_input();
  if (!read_all(header, sizeof header)) header[1] = 0;
  for (i = 0; i < header[1]; ++i) {
    uint32_t begin;
    uint64_t took;
    if (header[0] == 0) {
      if (!read_all(window, sizeof window)) break;
      begin = TIMER_NOW;
      finger_draw(window, picture, predicted_error);
    } else {
      double time_s;
      if (!read_all(&time_s, sizeof time_s) || !read_all(window, sizeof(float) * FINGER_SIGNALS)) break;
      begin = TIMER_NOW;
      if (!finger_push_at(time_s, window) || !finger_picture(picture, predicted_error)) continue;
    }
    took = instructions(begin);
    if (took > most) most = took;
    add(picture);
    if (header[0] == 0) add(predicted_error);
    ++pictures;
  }
  say("pictures", pictures);
  say("hash", hash);
  say("instructions", most);
  host(0x18, (const void *)0x20026);
}
