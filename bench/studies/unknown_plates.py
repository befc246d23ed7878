#!/usr/bin/env python3
"""Can a specialist tell that it feels a kind of plate it never felt? For each MODEL (trained on four plates of trial 1) and
each plate of another kind, the area under the ROC curve of "this window in contact is not of a known plate", by what a
network could go by; trial 2 of known and unknown plates against each other, what is usual taken from trial 1.
    unknown_plates.py BIN TRIAL_1 RECORDINGS RESULTS.csv MODEL ...
TRIAL_1 is a folder with the recordings of trial 1 alone. Needs NumPy and PyTorch (bench/peers/requirements.txt). A minute a model."""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import torch
import torch.nn.functional as F

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "peers"))
import pytorch_model  # noqa: E402

KNOWN = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"
UNKNOWN = ["4_Waves", "6_Waves", "4_Blob", "6_Blob"]


def windows_of(binaries, model, recordings, plates, split, limit, folder):
    """Inputs, truths and spreads of the split's test side, and the share of windows that raise today's alarm."""
    out, scores = folder / "windows.safetensors", folder / "scores.json"
    subprocess.run([binaries / "supertac-evaluate", "--model", model, "--data", recordings, "--plates", plates, "--split", split,
                    "--limit", str(limit), "--outputs", out, "--json", scores, "--force", "--quiet"],
                   check=True, stdout=subprocess.DEVNULL)
    tensors, _ = pytorch_model.read_safetensors(out)
    alarms = json.loads(scores.read_text()).get("trust", {}).get("unlike_training", 0)
    return tensors, alarms


def seen_by(network, tensors):
    """Per window: latents, the encoders' last layers, the squared error of what is decoded, the mean predicted spread."""
    x = torch.tensor(tensors["input"])
    with torch.no_grad():
        hidden = [network.features(x, i) for i in range(4)]
        latents = [F.linear(h, *network.encoders[i][2]) for i, h in enumerate(hidden)]
        errors = [((network.decode(z, i) - x[:, :, network.groups[i]]) ** 2).mean((1, 2)) for i, z in enumerate(latents)]
    signals = x.numpy()[:, ::8].reshape(len(x), -1)
    return {"signals": signals, "latents": torch.cat(latents, 1).numpy(), "last layer": torch.cat(hidden, 1).numpy(),
            "error": sum(errors).numpy(), "spread": tensors["spread"].reshape(len(x), -1).mean(1),
            "swing": x.std(1).mean(1).numpy()}


def mahalanobis(usual):
    mean, covariance = usual.mean(0), np.cov(usual.T)
    covariance += 1e-3 * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    return lambda x: np.linalg.norm((x - mean) @ whitening.T, axis=1)


def fifth_nearest(usual):
    size = usual.std(0) + 1e-3
    usual = usual / size
    squares = (usual ** 2).sum(1)

    def distance(x):
        x = x / size
        return np.concatenate([np.partition(squares + (y ** 2).sum(1)[:, None] - 2 * y @ usual.T, 4, axis=1)[:, 4]
                               for y in np.array_split(x, len(x) // 500 + 1)])

    return distance


def ways(usual):
    for of in ("latents", "last layer"):
        distance = mahalanobis(usual[of])
        yield f"Mahalanobis distance of the {of}", lambda s, d=distance, of=of: d(s[of])
    for of in ("latents", "signals"):
        distance = fifth_nearest(usual[of][::3])
        yield f"fifth nearest {of} of training", lambda s, d=distance, of=of: d(s[of])
    yield "reconstruction error", lambda s: s["error"]
    yield "reconstruction error as a share of the swing", lambda s: s["error"] / (s["swing"] ** 2 + 1e-4)
    yield "predicted spread", lambda s: s["spread"]


def auroc(usual, odd):
    return np.searchsorted(np.sort(usual), odd).mean() / len(usual)


def main():
    binaries, trial_1, recordings, results, *models = sys.argv[1:]
    binaries = pathlib.Path(binaries)
    lines = ["model,plate,way,auroc,alarms"]
    for number, model in enumerate(models):
        network = pytorch_model.SuperTac(model)
        with tempfile.TemporaryDirectory() as folder:

            def get(data, plates, split, limit):
                tensors, alarms = windows_of(binaries, model, data, plates, split, limit, pathlib.Path(folder))
                touched = np.abs(tensors["truth"]).reshape(len(tensors["truth"]), -1).max(1) > 0
                return {name: value[touched] for name, value in seen_by(network, tensors).items()}, alarms

            usual, _ = get(trial_1, KNOWN, "none", 12000)
            known, _ = get(recordings, KNOWN, "trial", 4000)
            for plate in UNKNOWN:
                unknown, alarms = get(recordings, plate, "trial", 2000)
                for way, score in ways(usual):
                    lines.append(f"{number},{plate},{way},{auroc(score(known), score(unknown)):.3f},{alarms:.4f}")
                print(lines[-1], flush=True)
    pathlib.Path(results).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
