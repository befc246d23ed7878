"""Pictures without a network, of single frames [n,H,W]: bicubic interpolation, its back-projection, and A+."""
import numpy as np


def bicubic(low: np.ndarray, scale: int) -> np.ndarray:
    """Keys' cubic convolution (1981, a = -1/2) with taxels in the middle of equal cells; the edge is repeated."""
    def weights(count):
        matrix = np.zeros((count * scale, count), np.float32)
        for pixel in range(count * scale):
            at = (pixel + 0.5) / scale - 0.5
            for tap in range(int(np.floor(at)) - 1, int(np.floor(at)) + 3):
                d = abs(at - tap)
                weight = (1.5 * d - 2.5) * d * d + 1 if d < 1 else ((-0.5 * d + 2.5) * d - 4) * d + 2 if d < 2 else 0
                matrix[pixel, min(max(tap, 0), count - 1)] += weight
        return matrix
    return weights(low.shape[1]) @ low @ weights(low.shape[2]).T


def pooled(high: np.ndarray, scale: int) -> np.ndarray:
    count, height, width = high.shape
    return high.reshape(count, height // scale, scale, width // scale, scale).mean(axis=(2, 4))


def back_projection(low: np.ndarray, scale: int, rounds: int = 20) -> np.ndarray:
    """What bicubic pictures lack when pooled again is interpolated and added (Irani and Peleg 1991)."""
    high = bicubic(low, scale)
    for _ in range(rounds):
        high = high + bicubic(low - pooled(high, scale), scale)
    return high


class APlus:
    """Timofte, De Smet, Van Gool 2014: patches of 3x3 taxels, described by first and second derivatives of the
    back-projected picture; the nearest of `atoms`, which K-SVD learnt (Aharon 2006), has a ridge regression to what
    the picture lacks, from the `neighbours` nearest patches of the training frames."""

    def __init__(self, low, high, scale, atoms=128, neighbours=1024, patches=40_000, penalty=0.1, seed=0):
        self.scale, self.side = scale, 3 * scale
        random = np.random.default_rng(seed)
        chosen = random.permutation(len(low))[:1500]
        start = back_projection(low[chosen], scale)
        features, lacks = self._features(start), self._patches((high[chosen] - start)[:, None])
        kept = random.permutation(len(features))[:patches]
        features, lacks = features[kept], lacks[kept]
        values, vectors = np.linalg.eigh(features.T @ features)
        enough = np.cumsum(values[::-1]) <= 0.999 * values.sum()
        self.basis = vectors[:, ::-1][:, : max(1, enough.sum() + 1)]
        features = features @ self.basis
        length = np.linalg.norm(features, axis=1)
        features, lacks, length = (part[length > 1e-3] for part in (features, lacks, length))
        unit = features / length[:, None]
        self.atoms = k_svd(unit, atoms, random)
        self.maps = []
        for atom in self.atoms:
            near = np.argsort(-np.abs(unit @ atom))[:neighbours]
            a, b = unit[near], lacks[near] / length[near, None]
            self.maps.append(np.linalg.solve(a.T @ a + penalty * np.eye(a.shape[1], dtype=a.dtype), a.T @ b))
        self.maps = np.stack(self.maps).astype(np.float32)

    def _features(self, pictures):
        def derivative(axis, order):
            taps = [(-self.scale, -1), (self.scale, 1)] if order == 1 else [(-self.scale, 1), (0, -2), (self.scale, 1)]
            reach = [(0, 0)] * 3
            reach[axis] = (self.scale, self.scale)
            padded = np.pad(pictures, reach, mode="edge")
            return sum(weight * padded.take(np.arange(pictures.shape[axis]) + self.scale + shift, axis)
                       for shift, weight in taps)
        maps = np.stack([derivative(axis, order) for axis in (1, 2) for order in (1, 2)], axis=1)
        return self._patches(maps)

    def _patches(self, maps):
        """[patches,C side side] of maps [n,C,H,W], by picture, line and column."""
        view = np.lib.stride_tricks.sliding_window_view(maps, (self.side, self.side), axis=(2, 3))
        view = view[:, :, ::self.scale, ::self.scale].transpose(0, 2, 3, 1, 4, 5)
        return view.reshape(-1, maps.shape[1] * self.side ** 2)

    def __call__(self, low: np.ndarray, at_once: int = 100) -> np.ndarray:
        return np.concatenate([self._draw(low[i:i + at_once]) for i in range(0, len(low), at_once)])

    def _draw(self, low):
        start = back_projection(low, self.scale)
        features = self._features(start) @ self.basis
        nearest = np.abs(features @ self.atoms.T).argmax(axis=1)
        lacks = np.empty((len(features), self.side ** 2), np.float32)
        for atom in np.unique(nearest):
            lacks[nearest == atom] = features[nearest == atom] @ self.maps[atom]
        pixels = self._patches(np.arange(start.size).reshape(start.shape)[:, None]).ravel()
        added = np.bincount(pixels, lacks.ravel(), start.size) / np.maximum(np.bincount(pixels, minlength=start.size), 1)
        return start + added.reshape(start.shape).astype(np.float32)


def k_svd(samples, atoms, random, rounds=8, sparsity=3):
    """Atoms [atoms,features] of length 1; codes by orthogonal matching pursuit."""
    dictionary = samples[random.permutation(len(samples))[:atoms]].copy()
    samples = samples[random.permutation(len(samples))[:8000]]
    for _ in range(rounds):
        codes = np.zeros((len(samples), len(dictionary)), samples.dtype)
        for i, sample in enumerate(samples):
            support, rest = [], sample
            for _ in range(sparsity):
                best = int(np.abs(dictionary @ rest).argmax())
                if best in support:  # what is left lies in no atom
                    break
                support.append(best)
                solution = np.linalg.lstsq(dictionary[support].T, sample, rcond=None)[0]
                rest = sample - solution @ dictionary[support]
            codes[i, support] = solution
        for k in range(len(dictionary)):
            users = np.flatnonzero(codes[:, k])
            if len(users) == 0:
                dictionary[k] = samples[random.integers(len(samples))]
                continue
            rest = samples[users] - codes[users] @ dictionary + np.outer(codes[users, k], dictionary[k])
            _, _, right = np.linalg.svd(rest, full_matrices=False)
            dictionary[k], codes[users, k] = right[0], rest @ right[0]
    return dictionary


def ssim(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[n]: Wang 2004, Gaussian window of 11x11 with sigma 1.5, data range 1, valid positions."""
    taps = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    taps /= taps.sum()

    def blur(x):
        for axis in (1, 2):
            x = np.lib.stride_tricks.sliding_window_view(x, 11, axis=axis) @ taps
        return x
    a, b = a.astype(np.float64), b.astype(np.float64)
    ma, mb = blur(a), blur(b)
    va, vb, cov = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    score = (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4))
    return score.mean(axis=(1, 2))


def psnr_db(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.minimum(60, -10 * np.log10(np.maximum(((a.astype(np.float64) - b) ** 2).mean(axis=(1, 2)), 1e-12)))
