// What supertac-check asks. Each returns the exit code; those of a training throw as supertac-train does.
#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// `supertac-check machine`: processor, threads, memory, disk, serial ports, who may open them and who takes
/// them, and what to do about each.
int check_machine(const Arguments& a);
/// `supertac-check udev`: the text of a file for /etc/udev/rules.d.
int print_udev_rule(const Arguments& a);

/// `supertac-check bits`: the hashes of a simulated pass, of ten training steps and of pictures in fp32 and
/// int8, on every instruction set that this processor has, against those that every processor has to give.
int check_bits(const Arguments& a);

/// `supertac-check file`: checksum and content hash, and whether its data are those given.
int check_file(const Arguments& a);

/// `supertac-check chain`: the links from recordings to the picture of a microcontroller
/// (models/files/exports.h), each made again and compared with what the exported header states.
int check_chain(const Arguments& a);

/// `supertac-check training`: repeats pieces of a training from its kept states and compares every line of
/// its ledger, all arrays of the state and the batches.
int check_training(const Arguments& a);

/// `supertac-check step`: repeats a training up to one step and opens it
/// (models/training/audit/opened_step.h).
int check_step(const Arguments& a);

}  // namespace supertac
