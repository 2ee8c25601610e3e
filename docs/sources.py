"""Makes what the site's pages are built of, before Sphinx: `make docs`.

That is the environment of the tutorials, the runs of the gallery, and the pages that are made from declarations. All of
it is left as it is where neither the product, nor its packages, nor the makers of these pages have changed.
"""

import hashlib
import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from itertools import repeat
from pathlib import Path

DOCS = Path(__file__).parent
BUILD = DOCS / "build"


def main() -> None:
    """Make them."""
    from support.kept_runs import code_key, kept_run  # here, since commands of the gallery import this file

    digest = hashlib.sha256(code_key().encode())
    for file in sorted([*DOCS.glob("*.*"), *(DOCS / "templates").iterdir()]):
        if file.name != "gallery.md":
            digest.update(f"\0{file.name}\0".encode() + file.read_bytes())
    key, stamp = digest.hexdigest(), BUILD / "sources"
    if stamp.exists() and stamp.read_text() == key and (DOCS / "gallery.md").exists():
        return
    stamp.unlink(missing_ok=True)

    import declared_pages
    import pictures
    import tutorial_kernel
    from gallery import gallery_experiment, gallery_run, kept_campaign, warm_up

    from handover.scenarios.catalog import SCENARIOS
    from handover.scenarios.published.catalog import EXPERIMENTS

    warm_up()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = [pool.submit(tutorial_kernel.make, BUILD / "tutorials")]
        made += [pool.submit(kept_campaign, name) for name in EXPERIMENTS]
        made += [pool.submit(kept_run, "run", name) for name in SCENARIOS]
    for each in made:
        each.result()
    pictures.check()
    files = repeat(BUILD / "files")
    with ProcessPoolExecutor(os.cpu_count()) as drawing:
        runs = dict(zip(SCENARIOS, drawing.map(gallery_run, SCENARIOS, files), strict=True))
        experiments = dict(zip(EXPERIMENTS, drawing.map(gallery_experiment, EXPERIMENTS, files), strict=True))
    declared_pages.write(DOCS, runs, experiments)
    for page in ("commands", "python"):
        (DOCS / "reference" / f"{page}.md").touch()  # Sphinx makes them of the product
    stamp.write_text(key)


if __name__ == "__main__":
    main()
