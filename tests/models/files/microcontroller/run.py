"""One hash of pictures by this computer's programs, by the exported C on this and on emulated computers, and on emulated
microcontrollers.

    run.py --bin build/bin [--model FILE --data DIR] [--windows N] [--frames N] [--csv FILE]

Without a model a small one is simulated and trained. Parts whose compiler or emulator is missing are left out;
exits with 77 where all are.
"""
import argparse
import csv
import glob
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ARM, RISCV = "arm-none-eabi-", "riscv64-unknown-elf-"
# name, compiler, qemu's program and machine, what the compiler is told
PARTS = [
    ("Cortex-M55", ARM, "arm -M mps3-an547", "-mcpu=cortex-m55 -mfloat-abi=hard"),
    ("Cortex-M7", ARM, "arm -M mps2-an500", "-mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard"),
    ("Cortex-M4F", ARM, "arm -M mps2-an386", "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard"),
    ("Cortex-M3", ARM, "arm -M mps2-an385", "-mcpu=cortex-m3"),
    ("Cortex-M0+", ARM, "arm -M mps2-an385", "-mcpu=cortex-m0plus"),  # its code, on an M3
    ("rv32imc", RISCV, "riscv32 -M virt -bios none", "-march=rv32imc -mabi=ilp32"),
    ("rv64gc", RISCV, "riscv64 -M virt -bios none", "-march=rv64gc -mabi=lp64d -mcmodel=medany"),
]
# The same code on Linux: name, compiler, what runs it.
COMPUTERS = [
    ("x86-64 by GCC", "gcc -O3 -march=native", ""),
    ("x86-64 by Clang", "clang -O3 -march=native", ""),
    ("aarch64", "aarch64-linux-gnu-gcc -O2 -static", "qemu-aarch64"),
    ("rv64gc on Linux", "riscv64-linux-gnu-gcc -O2 -static", "qemu-riscv64"),
]
CC = ["-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffunction-sections"]
# How a program without a system is linked.
LINKED = {ARM: ["-mthumb", HERE + "/startup.c", "-nostartfiles", "--specs=nano.specs", "-T", HERE + "/mps2.ld"],
          RISCV: [HERE + "/startup_riscv.c", "-nostartfiles", "--specs=picolibc.specs", "-T", HERE + "/virt.ld",
                  "-Wl,--no-warn-rwx-segments"]}


def tensors_of(path):
    """name -> (shape, bytes) of a safetensors file."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + length])
    begin = 8 + length
    return {name: (t["shape"], data[begin + t["data_offsets"][0]:begin + t["data_offsets"][1]])
            for name, t in header.items() if name != "__metadata__"}


def fnv(blocks):
    value = 14695981039346656037
    for block in blocks:
        for byte in block:
            value = ((value ^ byte) * 1099511628211) & 0xFFFFFFFFFFFFFFFF
    return value


def slices(tensor, count):
    shape, data = tensor
    size = len(data) // shape[0]
    return [data[i * size:(i + 1) * size] for i in range(count)]


def simulated(tools, folder, *words):
    subprocess.run([tools + "/supertac-simulate", "--out", folder, "--speeds", "10", "--passes", "1", "--quiet", *words],
                   check=True, stdout=subprocess.DEVNULL)
    return folder


def trained(tools, folder, preset):
    data, model = folder + "/recordings", folder + "/model.safetensors"
    simulated(tools, data, "--trials", "2", "--plates", "ridges6,plain")
    subprocess.run([tools + "/supertac-train", "--data", data, "--out", model, "--preset", preset, "--epochs", "1",
                    "--stride", "8", "--split", "trial", "--quiet"], check=True, stdout=subprocess.DEVNULL)
    return model, data


def windows_of(args, folder):
    """What the devices are given, and the hash of what this computer draws of it."""
    out = folder + "/outputs.safetensors"
    subprocess.run([args.bin + "/supertac-evaluate", "--model", args.model, "--data", args.data, "--precision", "int8",
                    "--limit", str(args.windows), "--outputs", out, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    tensors = tensors_of(out)
    error = next((tensors[name] for name in ("predicted_error", "spread") if name in tensors))
    count = tensors["input"][0][0]
    drawn = [part for pair in zip(slices(tensors["output"], count), slices(error, count)) for part in pair]
    return struct.pack("<ii", 0, count) + tensors["input"][1], count, fnv(drawn)


def frames_of(args, folder):
    """The same, frame by frame, of what supertac-stream draws of a recording."""
    recording = first_of(args.raw)
    out = folder + "/streamed.safetensors"
    tensors = tensors_of(recording)
    count = min(args.frames, tensors["time_s"][0][0])
    times, values = slices(tensors["time_s"], count), slices(tensors.get("volts") or tensors["signals"], count)
    seconds = struct.unpack("<d", times[-1])[0] - struct.unpack("<d", times[0])[0] + 1e-6
    subprocess.run([args.bin + "/supertac-stream", "--model", args.model, "--recording", recording, "--precision",
                    "int8", "--seconds", str(seconds), "--out", out, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    drawn = tensors_of(out)
    pictures = next(drawn[name] for name in ("picture", "pictures") if name in drawn)
    frames = b"".join(t + v for t, v in zip(times, values))
    return struct.pack("<ii", 1, count) + frames, pictures[0][0], fnv(slices(pictures, pictures[0][0]))


def first_of(folder):
    return sorted(glob.glob(folder + "/*.safetensors"))[0]


def rate_of(recording):
    shape, times = tensors_of(recording)["time_s"]
    times = struct.unpack("<%dd" % shape[0], times)
    steps = sorted(b - a for a, b in zip(times, times[1:]))
    return 1 / steps[len(steps) // 2]


def built(tools, flags, folder, name):
    """The program, bytes of flash and RAM of the exported file alone, and of its instructions."""
    program, compiler = folder + "/" + name + ".elf", [tools + "gcc", *CC, *flags.split(), "-I" + folder]
    subprocess.run([*compiler, HERE + "/firmware.c", folder + "/finger.c", *LINKED[tools], "-Wl,--gc-sections", "-o", program],
                   check=True)
    thumb = ["-mthumb"] if tools == ARM else ["--specs=picolibc.specs"]
    subprocess.run([*compiler, *thumb, "-c", folder + "/finger.c", "-o", program + ".o"], check=True)
    size = subprocess.run([tools + "size", "-A", program + ".o"], check=True, capture_output=True, text=True)
    sections = [line.split() for line in size.stdout.splitlines() if line.startswith(".")]

    def total(*prefixes):
        return sum(int(s[1]) for s in sections if s[0].startswith(prefixes))
    return program, total(".text", ".rodata"), total(".bss", ".data"), total(".text")


def sketch_compiles(folder):
    """The Arduino sketch against a stub of Arduino's functions."""
    sketch = os.path.join(HERE, "../../../../examples/microcontroller/finger/finger.ino")
    ran = subprocess.run(["arm-none-eabi-g++", "-mcpu=cortex-m7", "-mthumb", "-std=gnu++17", "-O2", "-Wall", "-Wextra",
                          "-Werror", "-I" + HERE, "-I" + folder, "-include", "Arduino.h", "-x", "c++", "-c", sketch,
                          "-o", folder + "/sketch.o"], check=False)
    print("the sketch compiles" if ran.returncode == 0 else "the sketch does not compile")
    return ran.returncode == 0


def on_computer(compiler, emulator, folder):
    """How the program is run on Linux."""
    program = folder + "/computer"
    subprocess.run([*compiler.split(), "-std=gnu99", "-Wall", "-Wextra", "-Werror", "-I" + folder, HERE + "/firmware.c",
                    folder + "/finger.c", "-o", program], check=True)
    return [*emulator.split(), program]


def on_board(machine, program):
    return [*("qemu-system-" + machine).split(), "-kernel", program, "-icount", "shift=0", "-semihosting-config",
            "enable=on,target=native", "-nographic", "-monitor", "none", "-serial", "none"]


def run(words, folder, given):
    with open(folder + "/input", "wb") as file:
        file.write(given)
    ran = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=7200)
    said = dict(line.split() for line in (ran.stdout + ran.stderr).splitlines() if len(line.split()) == 2)
    return {key: int(said[key]) for key in ("pictures", "hash", "instructions", "self_test")}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--model")
    parser.add_argument("--data", help="recordings for MODEL, of signals that have gone through no filter")
    parser.add_argument("--windows", type=int, default=1000)
    parser.add_argument("--frames", type=int, default=3000)
    parser.add_argument("--csv", help="adds a line for each part to this file")
    parser.add_argument("--preset", default="tiny", help="of the small one")
    args = parser.parse_args()
    parts = [part for part in PARTS if shutil.which(part[1] + "gcc") and shutil.which("qemu-system-" + part[2].split()[0])]
    if not parts:
        print("skipped: needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm, or gcc-riscv64-unknown-elf, "
              "picolibc-riscv64-unknown-elf and qemu-system-misc")
        return 77
    wrong, rows = 0, []

    def same(name, words, folder):
        """Draws all that is given, and says what came; a row's entries."""
        nonlocal wrong
        row = {}
        for what, (data, count, expected) in given.items():
            found = run(words, folder, data)
            good = found["hash"] == expected and found["pictures"] == count and found["self_test"] == 1
            wrong += not good
            row.update({what: count, what + "_hash": f"{found['hash']:016x}", what + "_instructions": found["instructions"]})
            print(f"{name}: {found['pictures']} pictures of {what}, hash {found['hash']:016x}, self-test "
                  f"{'good' if found['self_test'] else 'BAD'}{'' if good else f', expected {expected:016x} of {count}'}"
                  + (f", at most {found['instructions']} instructions a picture" if found["instructions"] else ""), flush=True)
        return row

    with tempfile.TemporaryDirectory() as folder:
        args.raw = args.data  # frames as a sensor gives them: the device filters them as the training signals were
        if args.model is None:
            args.model, args.data = trained(args.bin, folder, args.preset)
            args.raw = simulated(args.bin, folder + "/raw", "--trials", "1", "--plates", "ridges6", "--sensor", "rig")
        recording = first_of(args.raw)
        subprocess.run([args.bin + "/supertac-export", args.model, "--c99", folder, "--name", "finger", "--sensor-hz",
                        repr(rate_of(recording)), "--force"], check=True, stdout=subprocess.DEVNULL)
        given = {"windows": windows_of(args, folder), "frames": frames_of(args, folder)}
        wrong += bool(shutil.which(ARM + "g++")) and not sketch_compiles(folder)
        for name, compiler, emulator in COMPUTERS:
            if all(shutil.which(words.split()[0]) for words in (compiler, emulator) if words):
                same(name, on_computer(compiler, emulator, folder), folder)
        for name, tools, machine, flags in parts:
            program, flash, ram, code = built(tools, flags, folder, name)
            row = {"part": name, "flash_bytes": flash, "code_bytes": code, "ram_bytes": ram,
                   **same(name, on_board(machine, program), folder)}
            print(f"{name}: {flash} bytes of flash, {code} of them code, {ram} of RAM with the window")
            rows.append(row)
    if args.csv:
        commit = subprocess.run(["git", "-C", HERE, "rev-parse", "--short=12", "HEAD"], check=True, capture_output=True,
                                text=True).stdout.strip()
        command = (f"tests/models/files/microcontroller/run.py --preset {args.preset} --windows {args.windows} --frames "
                   f"{args.frames}")
        new = not os.path.exists(args.csv)
        with open(args.csv, "a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, ["preset", *rows[0].keys(), "command", "commit"], lineterminator="\n")
            if new:
                writer.writeheader()
            writer.writerows({"preset": args.preset, **row, "command": command, "commit": commit} for row in rows)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
