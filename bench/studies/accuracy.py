#!/usr/bin/env python3
"""The figures of bench/results/accuracy.md and unseen_plates.md, from the real recordings as text.

    bench/studies/accuracy.py known  BIN TEXT_DIR OUT_DIR [SEEDS]    presets paper and tiny, passes aligned and not
    bench/studies/accuracy.py passes BIN TEXT_DIR OUT_DIR [SEEDS]    preset paper, and with --delay, by pass, pictures and
                                                                     maps; no pass of trial 2 has helped to find a
                                                                     place of trial 1
    bench/studies/accuracy.py elements BIN TEXT_DIR OUT_DIR [SEEDS]  what maps show of known plates (trial 2), and of each of
                                                                     them when it was left out of the training; with its
                                                                     kind stated and without
    bench/studies/accuracy.py unseen BIN TEXT_DIR OUT_DIR [SEEDS]    one plate left out of trial 1, random plates beside it

SEEDS: 0,1,2,3,4. About six minutes a network on one core; what is there in OUT_DIR is not made again, so a run can be
interrupted. Writes OUT_DIR/whole_passes.csv, passes.csv, surfaces.csv and baselines.csv, elements.csv, or left_out.csv, whose
lines replace those of bench/results. Choices are made on trial 1 (bench/README.md); this looks at trial 2.
"""
import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import write  # noqa: E402

KNOWN = ("3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges")
PLATES = (*KNOWN, "4_Blob", "6_Blob", "4_Waves", "6_Waves")
PRESETS = ("paper", "tiny")
RANDOM = ["--preset", "tiny", "--latent", "20", "--stride", "4", "--epochs", "12", "--random-plates", "1500"]
FEWER = [*RANDOM[:-3], "10", "--random-plates", "800"]  # a minute and a half
FIGURES = {"contact_ssim": ("contact", "ssim"), "contact_psnr_db": ("contact", "psnr_mean_db"),
           "position_error_mm": ("contact", "position_error_mm"), "miss_rate": ("contact", "miss_rate"),
           "flat_ghost_rate": ("flat", "ghost_rate"), "coverage": ("trust", "coverage")}


class Study:
    def __init__(self, binaries, text, out, seeds="0,1,2,3,4"):
        self.bin, self.text, self.out = (pathlib.Path(p).resolve() for p in (binaries, text, out))
        self.seeds = seeds.split(",")
        self.out.mkdir(parents=True, exist_ok=True)
        self.all = self.imported("recordings", self.text)
        self.trial1 = self.linked("trial1", {p.name: p for p in self.all.glob("*_t1_*")})  # aligned with trial 2
        self.first, self.alone = self.trial_alone("trial1_alone", 1), self.trial_alone("independent", 2)

    def run(self, program, *words):
        subprocess.run([str(self.bin / program), *map(str, words)], check=True, stdout=subprocess.DEVNULL)

    def imported(self, name, text):
        if not (self.out / name).exists():
            self.run("supertac-import", text, "--out", self.out / name)
        return self.out / name

    def linked(self, name, targets):
        for link, target in targets.items():
            path = self.out / name / link
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.is_symlink():
                path.symlink_to(target)
        return self.out / name

    def trial_alone(self, name, trial):
        texts = {f"{plate}/{trial}": self.text / plate / str(trial) for plate in PLATES}
        texts = {link: target for link, target in texts.items() if target.is_dir()}
        return self.imported(name, self.linked(f"text{trial}", texts))

    def train(self, name, data, *options):
        path = self.out / f"{name}.safetensors"
        if not path.exists():
            self.run("supertac-train", "--data", data, "--out", path, "--threads", 1, "--force", *options)
        return path

    def apart(self):
        """Trial 1 and trial 2, each registered without the other."""
        return self.linked("apart", {p.name: p for of in (self.first, self.alone) for p in of.glob("*.safetensors")})

    def trained_apart(self, name, plates, seed, *options):
        return self.train(name, self.apart(), "--split", "trial", "--seed", seed, "--plates", ",".join(plates), *options)

    def evaluated(self, name, models, data, *options):
        path = self.out / f"{name}.json"
        if not path.exists():
            self.run("supertac-evaluate", "--model", ",".join(map(str, models)), "--data", data, "--json", path, *options)
        return json.loads(path.read_text())

    def scores(self, name, models, data, *options):
        found = self.evaluated(name, models, data, *options)
        return {figure: f"{found[part][key]:.4f}" if found.get(part, {}).get(key) is not None else ""
                for figure, (part, key) in FIGURES.items()}


def known(study):
    plates, lines = ["--plates", ",".join(KNOWN)], []

    def score(network, seed, models):
        for how, data, split in (("aligned", study.all, []), ("independent", study.alone, ["--split", "none"])):
            found = study.scores(f"{network.replace(' ', '_')}_s{seed}_{how}", models, data, *plates, *split)
            lines.append({"network": network, "registered": how, "seed": seed, **found})

    for preset in PRESETS:
        for seed in study.seeds:
            options = ["--preset", preset, "--split", "trial", "--seed", seed, *plates]
            score(preset, seed, [study.train(f"{preset}_s{seed}", study.all, *options)])
    write(study.out / "whole_passes.csv", lines)


def by_pass(found, drawn=None):
    """What an evaluation says of each pass: of the pictures, and as read back from the two maps; and from those `drawn` with
    elements of the kind that they resemble most."""
    of = {"": found, "map_": found["map"]["of_pass"], "plate_map_": found["map"]["of_surface"]}
    if drawn:
        of |= {"kind_map_": drawn["map"]["of_pass"], "kind_plate_map_": drawn["map"]["of_surface"]}
    parts = {prefix: part["over_passes"]["passes"] for prefix, part in of.items()}
    for number, one in enumerate(parts[""]):
        yield {key: one[key] for key in ("plate", "trial", "pass", "windows")} | {
            prefix + name: f"{part[number][key]:.4f}" for prefix, part in parts.items()
            for key, name in (("ssim", "ssim"), ("psnr_mean_db", "psnr_db"))} | (
                drawn["map"]["passes"][f"{one['plate']}_t{one['trial']}_p{one['pass']}"] if drawn else {})


def of_surface(found):
    """And of one plate."""
    line = {"windows": found["contact"]["windows"], "position_error_mm": f"{found['contact']['position_error_mm']:.4f}"}
    for prefix, part in (("", found), ("map_", found["map"]["of_pass"])):
        first = [one for one in part["by_distance"] if one["from_mm"] < 15]
        line["first_15_mm_windows"] = sum(one["windows"] for one in first)
        line[prefix + "first_15_mm_ssim"] = f"{sum(one['ssim'] * one['windows'] for one in first) / line['first_15_mm_windows']:.4f}"
    for truth, held in found["trust"]["coverage_of"].items():
        line |= {f"{truth}, pixels": f"{held['pixels']:.0f}", f"{truth}, held": f"{held['share']:.4f}",
                 f"{truth}, half width": f"{held['half_width']:.4f}"}
    return line


def passes(study):
    models, lines, surfaces, both = {}, [], [], study.apart()
    for name, network, *delay in (("late", "paper, 0.6 s later", "--delay", "0.6"), ("apart", "paper")):
        for seed in study.seeds:
            models[seed] = study.trained_apart(f"{name}_s{seed}", KNOWN, seed, *delay)
            found, drawn = (study.evaluated(f"{name}_s{seed}_{of}", [models[seed]], both, *also)
                            for of, *also in (("passes",), ("kinds", "--elements", "any")))
            lines += [{"network": network, "seed": seed, **one} for one in by_pass(found, drawn)]
            baselines = [{"method": method, "ssim": one["contact"]["ssim"], "psnr_db": one["contact"]["psnr_mean_db"]}
                         for method, one in found["baselines"].items()]
            for plate in KNOWN:
                found = study.evaluated(f"{name}_s{seed}_{plate}", [models[seed]], both, "--plates", plate)
                surfaces.append({"network": network, "seed": seed, "plate": plate, **of_surface(found)})
    for seed in study.seeds if len(study.seeds) > 1 else ():
        found = study.evaluated(f"apart_without_s{seed}_passes", [m for s, m in models.items() if s != seed], both)
        lines += [{"network": "all but this one, averaged", "seed": seed, **one} for one in by_pass(found)]
    write(study.out / "passes.csv", lines)
    write(study.out / "surfaces.csv", surfaces)
    write(study.out / "baselines.csv", baselines)


def elements(study):
    lines = []

    def score(network, seed, model, plate, trial):
        data, kind = (study.first, study.alone)[trial - 1], plate.split("_")[1].lower()
        name = f"elements_{network.replace(' ', '_')}_s{seed}_{plate}_t{trial}"
        found, drawn = (study.evaluated(name + also[-1], [model], data, "--split", "none", "--plates", plate, *also[:-1])
                        for also in (["_found"], ["--elements", kind, "_stated"]))
        for maps, of in (("pass", "of_pass"), ("plate", "of_surface")):
            lines.append({"network": network, "seed": seed, "plate": plate, "trial": trial, "map_of": maps,
                          "ssim": found["map"][of]["ssim"], "stated_ssim": drawn["map"][of]["ssim"],
                          **found["map"][of]["elements"]})

    def left_out(plate):
        return "--split", "texture", "--leave-out", plate, "--plates", ",".join(KNOWN)

    for plate in KNOWN:
        for seed in study.seeds:
            score("paper", seed, study.trained_apart(f"apart_s{seed}", KNOWN, seed), plate, 2)
            score("paper, 0.6 s later", seed, study.trained_apart(f"late_s{seed}", KNOWN, seed, "--delay", "0.6"), plate, 2)
            late = study.train(f"late_beside_without_{plate}_s{seed}", study.first, *FEWER, "--delay", "0.6", "--seed", seed,
                               *left_out(plate))
            for trial in (1, 2):
                score("random plates beside, 0.6 s later", seed, late, plate, trial)
        model = study.trained_apart(f"apart_without_{plate}", [p for p in KNOWN if p != plate], 0)
        beside = study.train(f"beside_without_{plate}", study.first, *FEWER, *left_out(plate))
        for trial in (1, 2):
            score("without the plate", 0, model, plate, trial)
            score("random plates beside", 0, beside, plate, trial)
    write(study.out / "elements.csv", lines)


def unseen(study):
    lines = []
    for plate in PLATES:
        for seed in study.seeds:
            name = f"without_{plate}_s{seed}"
            split = ["--split", "texture", "--leave-out", plate, "--seed", seed]
            model = study.train(name, study.trial1, *RANDOM, *split)
            line = {"left_out": plate, "seed": seed, **study.scores(name, [model], study.trial1)}
            alone = study.scores(name + "_independent", [model], study.alone, "--split", "none", "--plates", plate)
            line["independent_ssim"], line["without_random_plates_ssim"] = alone["contact_ssim"], ""
            if plate in KNOWN:
                others = study.train(f"known_{name}", study.trial1, "--preset", "tiny", "--plates", ",".join(KNOWN), *split)
                scores = study.scores(f"known_{name}", [others], study.trial1, "--plates", ",".join(KNOWN))
                line["without_random_plates_ssim"] = scores["contact_ssim"]
            lines.append(line)
    write(study.out / "left_out.csv", lines)


if __name__ == "__main__":
    studies = {"known": known, "passes": passes, "elements": elements, "unseen": unseen}
    if len(sys.argv) not in (5, 6) or sys.argv[1] not in studies:
        sys.exit(__doc__)
    studies[sys.argv[1]](Study(*sys.argv[2:]))
