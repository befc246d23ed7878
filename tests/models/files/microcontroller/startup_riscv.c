/* What a bare RISC-V of qemu's machine "virt" needs before run(): its memory begins at 0x80000000 and is 0. */
void run(void);

__attribute__((naked, section(".text.start"))) void _start(void) {
  __asm__ volatile(
      ".option arch, +zicsr\n"
      "li sp, 0x87fffff0\n"
      "li t0, 0x6000\n" /* floating point, where there is any */
      "csrs mstatus, t0\n"
      "call run\n"
      "1: j 1b\n");
}
