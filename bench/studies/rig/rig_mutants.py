#!/usr/bin/env python3
"""Breaks each of the rig's 19 behaviours in a copy of the tree and shows the test that then fails.

    bench/studies/rig/rig_mutants.py SOURCE SCRATCH [FIRST]

SOURCE is copied to SCRATCH/tree, every mutant is put in behind a switch (the environment variable SUPERTAC_MUTANT),
the copy is built once, and each mutant is run against the tests that are to catch it. Prints one line a mutant;
exit code 1 when one survives.
"""

import glob
import os
import shutil
import subprocess
import sys

# behaviour, what is broken, file, text, its replacement (MUTANT: true when this mutant is on), tests
MUTANTS = [
    (1, "never probes, waits for a banner", "marlin_link.cpp",
     'send("\\n" + numbered_line(0, "M110 N0"));', 'if (!MUTANT) send("\\n" + numbered_line(0, "M110 N0"));',
     "MarlinLink.Connects*"),
    (2, "checksum without the number", "marlin_line.cpp",
     "std::to_string(marlin_checksum(line))", "std::to_string(marlin_checksum(MUTANT ? command : line))",
     "MarlinLine.NumberedLine*:MarlinLink.Connects*"),
    (2, "lines longer than 96 bytes", "marlin_line.cpp", "if (line.size() > kMaxLineBytes) {",
     "if (line.size() > kMaxLineBytes && !MUTANT) {", "MarlinLine.RefusesWhat*"),
    (3, "the ok of a resend acknowledges", "marlin_link.cpp", "  if (exchange.fault) {", "  if (exchange.fault && !MUTANT) {",
     "MarlinLink.DamagedLine*"),
    (3, "no end to resending", "marlin_link.cpp", "if (++exchange.repeats > settings_.max_repeats || loop) {",
     "if ((++exchange.repeats > settings_.max_repeats || loop) && !MUTANT) {", "MarlinLink.SameLineTooOften*"),
    (4, "asks by the same line", "marlin_link.cpp", "numbered_line(number_ + kFarAhead,", "numbered_line(number_ + (MUTANT ? 0 : kFarAhead),",
     "MarlinLink.LostOk*:MarlinLink.EveryLineRunsOnce*"),
    (5, "an unknown command counts as run", "marlin_link.cpp",
     "  ++counters_.faults;\n  exchange.fault = true;\n}", "  ++counters_.faults;\n  exchange.fault = !MUTANT;\n}",
     "MarlinLink.LostLeadingN*"),
    (6, "busy renews nothing", "marlin_link.cpp", "exchange.until = std::max(exchange.until, input_time_",
     "if (!MUTANT) exchange.until = std::max(exchange.until, input_time_", "MarlinLink.BusyRenews*"),
    (6, "paused is no error", "marlin_link.cpp", "if (reply.kind == ReplyKind::paused && connected_) {",
     "if (reply.kind == ReplyKind::paused && connected_ && !MUTANT) {", "MarlinLink.PausedForUser*"),
    (7, "a banner in mid-run is ignored", "marlin_link.cpp", "if (reply.kind == ReplyKind::start && connected_) {",
     "if (reply.kind == ReplyKind::start && connected_ && !MUTANT) {", "MarlinLink.StartInMidRun*:Palpation.AResetInTheSlide*"),
    (7, "a line number that fell to 0 is followed", "marlin_link.cpp", "if (next <= 1) {", "if (next <= 1 && !MUTANT) {",
     "MarlinLink.AResetWhoseBannerIsLost*"),
    (7, "a halt is forgotten", "marlin_link.cpp", "halted_ = true;", "halted_ = !MUTANT;", "MarlinLink.AfterAHalt*"),
    (8, "the stop waits in the queue", "printer.cpp", 'link_.emergency("M410");',
     'if (MUTANT) link_.command("M410", 60); else link_.emergency("M410");', "Printer.StopsDuringM400:Printer.QuickStop*"),
    (8, "silent about a missing emergency parser", "printer.cpp", "if (!stop.ahead_of_queue && !klipper)\n",
     "if (!stop.ahead_of_queue && !klipper && !MUTANT)\n", "Printer.SaysSoWithout*"),
    (9, "only targets are checked", "limits.cpp", "if (std::min(from.z, to.z) >= clearance_z) return;",
     "if (MUTANT || std::min(from.z, to.z) >= clearance_z) return;", "Limits.*:Palpation.TheWholeWay*"),
    (9, "no lift after a fault", "palpation.cpp", "printer_.lift(plan_.lift, plan_.speed_z);",
     "if (!MUTANT) printer_.lift(plan_.lift, plan_.speed_z);", "Palpation.AFaultInContact*:Palpation.Whatever*"),
    (9, "homes without lifting", "printer.cpp", 'link_.command("G1 Z10.000 F300");',
     'if (!MUTANT) link_.command("G1 Z10.000 F300");', "Printer.HomesWithTheFingerUp"),
    (10, "boundaries are believed", "printer.cpp", "if (distance(found, target_) <= settings_.tolerance_mm) return end;",
     "if (MUTANT || distance(found, target_) <= settings_.tolerance_mm) return end;", "Printer.MarlinsSilentClamp*"),
    (11, "end of file is a time-out", "serial_port.cpp", 'if (count == 0) unplugged("end of file");\n    if (errno == EINTR) continue;\n    if (errno != EAGAIN)',
     'if (MUTANT && (count == 0 || errno == EIO)) return {0, now()};\n    if (count == 0) unplugged("end of file");\n    if (errno == EINTR) continue;\n    if (errno != EAGAIN)',
     "SerialPort.Unplugging*:SerialPort.TimeOutAndEndOfFile*"),
    (12, "a partial write counts as whole", "serial_port.cpp", "bytes = bytes.subspan(static_cast<std::size_t>(count));",
     "bytes = bytes.subspan(MUTANT ? bytes.size() : static_cast<std::size_t>(count));", "SerialPort.OutputIsByteExact*:SerialPort.AFullDevice*"),
    (12, "a signal is a failure", "serial_port.cpp", "if (ready < 0 && errno != EINTR) unplugged",
     "if (ready < 0 && (MUTANT || errno != EINTR)) unplugged", "SerialPort.OutputIsByteExact*"),
    (13, "not exclusive", "serial_port.cpp", "if (flock(descriptor_, LOCK_EX | LOCK_NB) != 0)",
     "if (!MUTANT && flock(descriptor_, LOCK_EX | LOCK_NB) != 0)", "SerialPort.SecondOpener*"),
    (13, "not raw", "serial_termios.cpp", "settings.c_oflag = 0;", "settings.c_oflag = MUTANT ? OPOST | ONLCR : 0;",
     "SerialPort.OutputIsByteExact*"),
    (14, "rescans from the next frame", "frame_decoder.cpp", "    discard(1);", "    discard(MUTANT ? rig::kFrameBytes : 1);",
     "FrameDecoder.Recovers*"),
    (14, "high bytes unchecked", "board_frame.cpp", "return (seen & kHighNibbles) == 0 &&", "if (MUTANT) return true;\n  return (seen & kHighNibbles) == 0 &&",
     "BoardFrame.EveryHighByte*:FrameDecoder.AcceptsHardly*"),
    (15, "jumps are not flagged", "frame_clock.cpp", "const bool flag = far && flagged_ < 3;", "const bool flag = far && flagged_ < 3 && !MUTANT;",
     "JumpDetector.*"),
    (16, "gaps are not counted", "frame_clock.cpp", "missing_ = total;", "missing_ = MUTANT ? missing_ : total;", "FrameTimeline.*"),
    (16, "nothing is suspect after a stall", "tactile_board.cpp", "> 1.5 * rig::kFramePeriodS", "> (MUTANT ? 1e9 : 1.5) * rig::kFramePeriodS",
     "TactileBoard.LostFrames*"),
    (17, "the queue has no end", "tactile_board.cpp", "} else if (queue_.size() >= settings_.queue_frames) {",
     "} else if (queue_.size() >= settings_.queue_frames && !MUTANT) {", "TactileBoard.ASlowConsumer*"),
    (18, "any arrival of a block, not the earliest", "frame_clock.cpp", "if (in_block_ == 0 || lateness(point) < lateness(earliest_))",
     "if (MUTANT || in_block_ == 0 || lateness(point) < lateness(earliest_))", "ClockEstimator.LowerEnvelope*"),
    (18, "no warning", "frame_clock.cpp", "- 1) <= 0.005;", "- 1) <= (MUTANT ? 1 : 0.005);", "ClockEstimator.Warns*"),
    (19, "time-outs are not recorded", "capture.cpp", "journal_.append(stream_, kind, got.time_s, buffer.first(got.count));",
     "if (!MUTANT || got.count > 0) journal_.append(stream_, kind, got.time_s, buffer.first(got.count));", "Collection.AReplayGives*"),
    (19, "a replay takes whatever is sent", "capture.cpp", "if (!std::equal(bytes.begin()", "if (!MUTANT && !std::equal(bytes.begin()",
     "Collection.AReplayWithAnotherPlan*"),
]

SWITCH = "#include <cstdlib>\n#define MUTANT(number) (std::getenv(\"SUPERTAC_MUTANT\") != nullptr && std::atoi(std::getenv(\"SUPERTAC_MUTANT\")) == number)\n"


def plant(tree):
    """Puts every mutant into the copy, switched by its number from 1."""
    for number, (_, what, file, old, new, _) in enumerate(MUTANTS, 1):
        path, = glob.glob(os.path.join(tree, "hardware", "*", file))
        with open(path) as source:
            text = source.read()
        if text.count(old) < 1:
            sys.exit(f"mutants: {file} no longer holds what \"{what}\" replaces: {old}")
        text = text.replace(old, new.replace("MUTANT", f"MUTANT({number})"), 1)
        if not text.startswith(SWITCH):
            text = SWITCH + text
        with open(path, "w") as target:
            target.write(text)


def build(tree, folder):
    subprocess.run(["cmake", "-S", tree, "-B", folder, "-G", "Ninja", "-DSUPERTAC_APPS=OFF", "-DCMAKE_BUILD_TYPE=Release"],
                   check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", folder, "--target", "hardware_test"], check=True, stdout=subprocess.DEVNULL)
    return os.path.join(folder, "tests/hardware/hardware_test")


def failing(program, number, tests):
    """Names of the tests that fail with the mutant on."""
    environment = dict(os.environ, SUPERTAC_MUTANT=str(number))
    try:
        run = subprocess.run([program, f"--gtest_filter={tests}"], env=environment, capture_output=True, text=True, errors="replace",
                             timeout=120)
    except subprocess.TimeoutExpired:
        return ["(ran for more than 120 s)"]
    failed = [line.split()[3].rstrip(",") for line in run.stdout.splitlines() if line.startswith("[  FAILED  ]") and "ms)" in line]
    return failed or ([] if run.returncode == 0 else [f"(ended with {run.returncode})"])


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    source, scratch = sys.argv[1:3]
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    tree = os.path.join(scratch, "tree")
    if first == 1:
        shutil.copytree(source, tree, ignore=shutil.ignore_patterns(".git", "build*"), dirs_exist_ok=True)
        plant(tree)
    program = os.environ.get("SUPERTAC_MUTANTS_TEST") or build(tree, os.path.join(scratch, "build"))
    survivors = 0
    for number, (behaviour, what, *_, tests) in enumerate(MUTANTS, 1):
        if number < first:
            continue
        failed = failing(program, number, tests)
        survivors += 0 if failed else 1
        print(f"{number:2} | {behaviour:2} | {what} | {', '.join(failed) or 'SURVIVES'}", flush=True)
    sys.exit(1 if survivors else 0)


if __name__ == "__main__":
    main()
