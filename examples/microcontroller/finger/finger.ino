// Super-resolved pictures on a Teensy 4.1, or another Arduino with 128 kB of flash and 100 kB of RAM to spare: reads an
// array of 4x4 taxels and writes every picture to the USB cable, a line of 256 numbers.
//
// Beside this file belong finger.h and finger.c:
//   supertac-export model.safetensors --c99 examples/microcontroller/finger --name finger --sensor-hz 50
// It was compiled, and its network and live window run on an emulated Cortex-M7; it was not tried on a board.
#include "finger.h"

constexpr int kRows = 4, kColumns = 4;
constexpr int kRowPins[kRows] = {2, 3, 4, 5};  // a row is driven high, the others are left open
constexpr int kColumnPins[kColumns] = {A0, A1, A2, A3};
constexpr float kVoltsPerCount = 3.3F / 1023;
constexpr unsigned long kPeriodUs = 1000000UL / 50;

static_assert(kRows * kColumns == FINGER_SIGNALS, "the model is of another array");

static float frame[FINGER_SIGNALS], picture[FINGER_HEIGHT * FINGER_WIDTH];
static unsigned long next_us;

void setup() {
  Serial.begin(115200);
  for (const int pin : kRowPins) pinMode(pin, INPUT);
  next_us = micros();
}

static void read_frame() {
  for (int row = 0; row < kRows; ++row) {
    pinMode(kRowPins[row], OUTPUT);
    digitalWrite(kRowPins[row], HIGH);
    delayMicroseconds(50);  // the array settles
    for (int column = 0; column < kColumns; ++column)
      frame[row * kColumns + column] = static_cast<float>(analogRead(kColumnPins[column])) * kVoltsPerCount;
    pinMode(kRowPins[row], INPUT);
  }
}

void loop() {
  if (static_cast<long>(micros() - next_us) < 0) return;
  next_us += kPeriodUs;
  read_frame();
  if (!finger_push(frame) || !finger_picture(picture, nullptr)) return;
  for (int i = 0; i < FINGER_HEIGHT * FINGER_WIDTH; ++i) {
    Serial.print(picture[i], 3);
    Serial.print(i + 1 < FINGER_HEIGHT * FINGER_WIDTH ? ' ' : '\n');
  }
}
