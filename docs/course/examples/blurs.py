"""Adds noise to an image, takes it away with three blurs, and says how much is left.

python3 blurs.py [--size 5] [--noise 20] [--spikes 0.02] [--out FILE]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
import rospkg


def main() -> None:
    """Print the mean error of each blur; write the images side by side."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=5, help="of the square, odd, pixels")
    parser.add_argument("--noise", type=float, default=20.0, help="standard deviation, of 255")
    parser.add_argument("--spikes", type=float, default=0.0, help="share of pixels that are white")
    parser.add_argument("--out", type=Path, help="image to write")
    given = parser.parse_args()
    if given.size < 1 or given.size % 2 == 0:
        parser.error(f"size is {given.size}; expected an odd number >= 1")
    picture = Path(rospkg.RosPack().get_path("crazyflie_vision")) / "config" / "face.jpg"
    clean = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    chance = np.random.default_rng(1)
    noisy = np.clip(clean + chance.normal(0.0, given.noise, clean.shape), 0, 255).astype(np.uint8)
    noisy[chance.random(clean.shape) < given.spikes] = 255
    images = {
        "noisy": noisy,
        "box": cv2.blur(noisy, (given.size, given.size)),
        "Gaussian": cv2.GaussianBlur(noisy, (given.size, given.size), 0.0),
        "median": cv2.medianBlur(noisy, given.size),
    }
    for name, image in images.items():
        error = np.sqrt(np.mean((image.astype(float) - clean) ** 2))
        print(f"{name:9} rms error {error:5.1f}")
    if given.out:
        cv2.imwrite(str(given.out), np.hstack([clean, *images.values()]))


if __name__ == "__main__":
    main()
