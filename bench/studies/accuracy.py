#!/usr/bin/env python3
"""The figures of bench/results/accuracy.md and unseen_plates.md, from the real recordings as text.

    bench/studies/accuracy.py known  BIN TEXT_DIR OUT_DIR [SEEDS]    presets paper, best and tiny, and four of best averaged
    bench/studies/accuracy.py unseen BIN TEXT_DIR OUT_DIR [SEEDS]    one plate left out of trial 1, random plates beside it

SEEDS: 0,1,2,3,4. About six minutes a network on one core; what is there in OUT_DIR is not made again, so a run can be
interrupted. Writes OUT_DIR/whole_passes.csv or left_out.csv, whose lines replace those of bench/results. Choices are
made on trial 1 (bench/README.md); this looks at trial 2.
"""
import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import write  # noqa: E402

KNOWN = ("3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges")
PLATES = (*KNOWN, "4_Blob", "6_Blob", "4_Waves", "6_Waves")
PRESETS = ("paper", "best", "tiny")
RANDOM = ["--preset", "tiny", "--latent", "20", "--stride", "4", "--epochs", "12", "--random-plates", "1500"]
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
        trial2 = {f"{plate}/2": self.text / plate / "2" for plate in PLATES if (self.text / plate / "2").is_dir()}
        self.alone = self.imported("independent", self.linked("text2", trial2))

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

    def train(self, name, data, *options):
        path = self.out / f"{name}.safetensors"
        if not path.exists():
            self.run("supertac-train", "--data", data, "--out", path, "--threads", 1, "--force", *options)
        return path

    def scores(self, name, models, data, *options):
        path = self.out / f"{name}.json"
        if not path.exists():
            self.run("supertac-evaluate", "--model", ",".join(map(str, models)), "--data", data, "--json", path, *options)
        found = json.loads(path.read_text())
        return {figure: f"{found[part][key]:.4f}" if found.get(part, {}).get(key) is not None else ""
                for figure, (part, key) in FIGURES.items()}


def known(study):
    plates, lines = ["--plates", ",".join(KNOWN)], []

    def score(network, seed, models):
        for how, data, split in (("aligned", study.all, []), ("independent", study.alone, ["--split", "none"])):
            found = study.scores(f"{network.replace(' ', '_')}_s{seed}_{how}", models, data, *plates, *split)
            lines.append({"network": network, "registered": how, "seed": seed, **found})

    models = {}
    for preset in PRESETS:
        for seed in study.seeds:
            options = ["--preset", preset, "--split", "trial", "--seed", seed, *plates]
            models[preset, seed] = study.train(f"{preset}_s{seed}", study.all, *options)
            score(preset, seed, [models[preset, seed]])
    for left_out in study.seeds if len(study.seeds) > 1 else ():
        score("four of best averaged", left_out, [models["best", seed] for seed in study.seeds if seed != left_out])
    write(study.out / "whole_passes.csv", lines)


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
    if len(sys.argv) not in (5, 6) or sys.argv[1] not in ("known", "unseen"):
        sys.exit(__doc__)
    {"known": known, "unseen": unseen}[sys.argv[1]](Study(*sys.argv[2:]))
