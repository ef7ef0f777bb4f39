"""Pictures, pages and a summary of a run: sheet, film, viewers, text; contact sheet of a data set."""

from rfgen_sionna.show.browser_page import html_page
from rfgen_sionna.show.contact_sheet import draw_dataset_sheet
from rfgen_sionna.show.film import animation
from rfgen_sionna.show.page import sheet
from rfgen_sionna.show.rerun_view import open_in_rerun
from rfgen_sionna.show.run_summary import summary
from rfgen_sionna.show.run_view import NoPictureError

__all__ = [
    "NoPictureError", "animation", "draw_dataset_sheet", "html_page", "open_in_rerun", "sheet", "summary",
]  # fmt: skip
