#include "tests/hardware/virtual_rig/marlin_texts.h"

namespace supertac {

std::string marlin_banner() {
  return "start\nMarlin 2.1.2\n\necho: Last Updated: virtual rig | Author: (none)\necho:Compiled: none\n"
         "echo: Free Memory: 4096  PlannerBufferBytes: 1152\necho:Hardcoded Default Settings Loaded\n"
         "echo:; Linear Units:\necho:  G21 ; (mm)\necho:; Temperature Units:\n"
         "echo:  M149 C ; Units in Celsius\necho:; Filament settings (Disabled):\necho:  M200 S0 D1.75\n"
         "echo:; Steps per unit:\necho:  M92 X80.00 Y80.00 Z400.00 E500.00\n"
         "echo:; Max feedrates (units/s):\necho:  M203 X300.00 Y300.00 Z5.00 E25.00\n"
         "echo:; Max Acceleration (units/s2):\necho:  M201 X3000.00 Y3000.00 Z100.00 E10000.00\n"
         "echo:; Acceleration (units/s2) (P<print-accel> R<retract-accel> T<travel-accel>):\n"
         "echo:  M204 P500.00 R3000.00 T500.00\n"
         "echo:; Advanced (B<min_segment_time_us> S<min_feedrate> T<min_travel_feedrate>):\n"
         "echo:  M205 B20000.00 S0.00 T0.00 X10.00 Y10.00 Z0.30 E5.00\necho:; Home offset:\n"
         "echo:  M206 X0.00 Y0.00 Z0.00\necho:; Hotend PID:\necho:  M301 P22.20 I1.08 D114.00\n"
         "echo:; Material heatup parameters:\n";
}

std::string marlin_capabilities(bool emergency_parser) {
  return "FIRMWARE_NAME:Marlin 2.1.2 (virtual rig) SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin "
         "PROTOCOL_VERSION:1.0 MACHINE_TYPE:3D Printer EXTRUDER_COUNT:1 "
         "UUID:cede2a2f-41a2-4748-9b12-c55c62f367ff\n"
         "Cap:SERIAL_XON_XOFF:0\nCap:BINARY_FILE_TRANSFER:0\nCap:EEPROM:0\nCap:VOLUMETRIC:1\n"
         "Cap:AUTOREPORT_POS:1\nCap:AUTOREPORT_TEMP:1\nCap:PROGRESS:0\nCap:PRINT_JOB:1\nCap:AUTOLEVEL:0\n"
         "Cap:RUNOUT:0\nCap:Z_PROBE:0\nCap:LEVELING_DATA:0\nCap:BUILD_PERCENT:0\nCap:SOFTWARE_POWER:0\n"
         "Cap:TOGGLE_LIGHTS:0\nCap:CASE_LIGHT_BRIGHTNESS:0\nCap:EMERGENCY_PARSER:" +
         std::string(emergency_parser ? "1" : "0") +
         "\nCap:HOST_ACTION_COMMANDS:0\nCap:PROMPT_SUPPORT:0\nCap:SDCARD:0\nCap:REPEAT:0\nCap:SD_WRITE:0\n"
         "Cap:AUTOREPORT_SD_STATUS:0\nCap:LONG_FILENAME:0\nCap:THERMAL_PROTECTION:1\nCap:MOTION_MODES:0\n"
         "Cap:ARCS:1\nCap:BABYSTEPPING:0\nCap:CHAMBER_TEMPERATURE:0\nCap:COOLER_TEMPERATURE:0\n"
         "Cap:MEATPACK:0\n";
}

}  // namespace supertac
