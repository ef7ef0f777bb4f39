"""A data set from a recipe, a sheet of its recordings, and a network that learns its actions.

    python examples/dataset.py                       24 recordings of half a second, three actions
    python examples/dataset.py --quick               3 of a tenth of a second
    python examples/dataset.py --folder tiny/        keeps the set, and goes on with it the next time

Builds the set of examples/recipes/tiny.toml, draws its contact sheet, writes a page with one recording, trains on the
range-Doppler maps of the split "train" and counts what is right of "test".
"""

import argparse
import tempfile
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.torch import RadarDataset, to_db
from rfgen_sionna.recipes import Recipe, build_dataset
from rfgen_sionna.show import draw_dataset_sheet, html_page

RECIPE = Path(__file__).parent / "recipes" / "tiny.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, help="folder of the set; a temporary one without")
    parser.add_argument("--quick", action="store_true", help="3 recordings of a tenth of a second")
    parser.add_argument("--output", type=Path, default=Path("dataset.png"), help="contact sheet to draw")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.folder or Path(scratch) / "set"
        text = RECIPE.read_text(encoding="utf-8")
        if arguments.quick:
            text = text.replace("count = 24", "count = 3").replace("duration_s = 0.5", "duration_s = 0.1")
        report = build_dataset(Recipe.parse(text, RECIPE.parent), folder, resume=folder.exists())
        print(report)
        print(f"sheet      {draw_dataset_sheet(folder, arguments.output, overwrite=True)}")
        with open_dataset(folder) as recordings:
            page = html_page(recordings[0], arguments.output.with_suffix(".html"), overwrite=True)
            print(f"page       {page}")
        learn(folder, epochs=2 if arguments.quick else 15)


def learn(folder: Path, epochs: int) -> None:
    """Learn the action of a recording from its range-Doppler maps."""
    train, test = (RadarDataset(folder, split, transform=to_db) for split in ("train", "test"))
    frames = len(train[0][0])
    head = [torch.nn.AdaptiveMaxPool2d((1, 8)), torch.nn.Flatten(), torch.nn.Linear(128, len(train.classes))]
    layers = [torch.nn.BatchNorm2d(frames), torch.nn.Conv2d(frames, 16, 5, stride=4), torch.nn.ReLU(), *head]
    net = torch.nn.Sequential(*layers)
    optimizer = torch.optim.Adam(net.parameters(), 3e-3)
    for _ in range(epochs):
        for x, y in DataLoader(train, batch_size=6, shuffle=True):  # x: (item, frame, range, velocity) [dB]
            optimizer.zero_grad()
            torch.nn.functional.cross_entropy(net(x), y).backward()
            optimizer.step()
    right = sum(int(net.eval()(x[None]).argmax()) == y for x, y in test)
    print(f"network    {right} of {len(test)} test recordings are right, of the actions {', '.join(train.classes)}")


if __name__ == "__main__":
    main()
