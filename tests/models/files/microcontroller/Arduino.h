/* What examples/microcontroller calls of Arduino, for a compiler alone. */
#pragma once
#include <stdint.h>

enum { INPUT, OUTPUT, LOW = 0, HIGH = 1, A0 = 14, A1, A2, A3 };
void pinMode(int pin, int mode);
void digitalWrite(int pin, int level);
int analogRead(int pin);
unsigned long micros(void);
void delayMicroseconds(unsigned us);
struct SerialPort {
  void begin(long baud);
  void print(float value, int decimals);
  void print(char c);
};
extern SerialPort Serial;
