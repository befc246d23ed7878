#include <stdint.h>

extern uint32_t data_from[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];
void run(void);

static void stop(void) {
  for (;;) {
  }
}

static void reset(void) {
  uint32_t *to = data_begin;
  const uint32_t *from = data_from;
#if defined(__ARM_FP)
  *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* the floating-point unit on */
#endif
  while (to < data_end) *to++ = *from++;
  for (to = bss_begin; to < bss_end; ++to) *to = 0;
  run();
  stop();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    stack_top, (void *)reset, (void *)stop, (void *)stop, (void *)stop, (void *)stop, (void *)stop};
