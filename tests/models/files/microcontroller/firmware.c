/* Draws what the host gave it and says the hash of all pictures, under qemu with semihosting. Reads "input": 0 and a
   count of windows, or 1 and a count of frames, each a time and its values. */
#include <string.h>

#include "finger.h"

#if defined(__linux__) /* the same on a computer */
#include <stdio.h>
static FILE *input;
static void open_input(void) { input = fopen("input", "rb"); }
static int read_all(void *to, intptr_t size) { return fread(to, 1, (size_t)size, input) == (size_t)size; }
static void print(const char *line) { fputs(line, stdout); }
static uint32_t counted(void) { return 0; }
static uint64_t instructions(uint32_t since) { return since; }
static void begin_to_count(void) {}
static void end(void) {}
#else
#if defined(__riscv)
static intptr_t host(intptr_t operation, const void *arguments) {
  register intptr_t a0 __asm__("a0") = operation;
  register const void *a1 __asm__("a1") = arguments;
  __asm__ volatile(
      ".option push\n.option norvc\nslli x0, x0, 0x1f\nebreak\nsrai x0, x0, 7\n.option pop"
      : "+r"(a0)
      : "r"(a1)
      : "memory");
  return a0;
}
/* Instructions that have ended. */
static uint32_t counted(void) {
  uintptr_t count;
  __asm__ volatile(".option push\n.option arch, +zicsr\ncsrr %0, minstret\n.option pop" : "=r"(count));
  return (uint32_t)count;
}
static uint64_t instructions(uint32_t since) { return counted() - since; }
static void begin_to_count(void) {}
#else
static intptr_t host(intptr_t operation, const void *arguments) {
  register intptr_t r0 __asm__("r0") = operation;
  register const void *r1 __asm__("r1") = arguments;
  __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}
/* With -icount shift=0 an instruction takes a nanosecond, and the timer counts 25 MHz down. */
#define TIMER_CONTROL (*(volatile uint32_t *)0xE000E010)
#define TIMER_RELOAD (*(volatile uint32_t *)0xE000E014)
#define TIMER_NOW (*(volatile uint32_t *)0xE000E018)
static uint32_t counted(void) { return TIMER_NOW; }
static uint64_t instructions(uint32_t since) { return (uint64_t)((since - TIMER_NOW) & 0xFFFFFF) * 40; }
static void begin_to_count(void) { TIMER_RELOAD = 0xFFFFFF, TIMER_NOW = 0, TIMER_CONTROL = 5; }
#endif

static intptr_t input;

static void open_input(void) {
  static const char name[] = "input";
  const intptr_t arguments[] = {(intptr_t)name, 1 /* rb */, (intptr_t)(sizeof name - 1)};
  input = host(0x01, arguments);
}

static int read_all(void *to, intptr_t size) {
  const intptr_t arguments[] = {input, (intptr_t)to, size};
  return host(0x06, arguments) == 0;
}

static void print(const char *line) { host(0x04, line); }

static void end(void) {
  const intptr_t done[] = {0x20026, 0};
#if defined(__riscv) && __riscv_xlen == 64
  host(0x18, done);
#else
  host(0x18, (const void *)done[0]);
#endif
}
#endif

static void say(const char *name, uint64_t value) {
  char line[64] = {0}, digits[24];
  int n = 0, i = 0;
  while (name[n] != 0) line[n] = name[n], ++n;
  line[n++] = ' ';
  do digits[i++] = (char)('0' + value % 10);
  while ((value /= 10) > 0);
  while (i > 0) line[n++] = digits[--i];
  line[n++] = '\n';
  print(line);
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

static float window[FINGER_TIMESTEPS * FINGER_SIGNALS];
static float picture[FINGER_HEIGHT * FINGER_WIDTH], predicted_error[FINGER_HEIGHT * FINGER_WIDTH];

void run(void) {
  int32_t header[2], i;
  uint64_t most = 0, pictures = 0;
  begin_to_count();
  open_input();
  if (!read_all(header, sizeof header)) header[1] = 0;
  for (i = 0; i < header[1]; ++i) {
    uint32_t begin;
    uint64_t took;
    if (header[0] == 0) {
      if (!read_all(window, sizeof window)) break;
      begin = counted();
      finger_draw(window, picture, predicted_error);
    } else {
      double time_s;
      if (!read_all(&time_s, sizeof time_s) || !read_all(window, sizeof(float) * FINGER_SIGNALS)) break;
      begin = counted();
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
  say("self_test", finger_self_test(picture, predicted_error) == FINGER_SELF_TEST);
  end();
}

#if defined(__linux__)
int main(void) {
  run();
  return 0;
}
#endif
