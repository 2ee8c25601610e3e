"""What a command refuses: with status 2, in a line that says what is right, and nothing is written."""

import shlex
import shutil
import sys
from pathlib import Path

import pytest
from support.campaigns import campaign_metadata, folder_of, table_of
from support.commands import refusal
from support.cosim.native_units import native_fmu
from support.rewritten_archive import described_otherwise
from support.scenarios.sample_study import PLAN
from support.wording import Wording

from handover.cosim.fmu.file.archive import write_archive
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.plan import default_plan

CALLS = """
list nothing_like_it
list Push --html a.html
list --json --html a.html
list --html Push
info none.fmu
info own_broken.py
info ran
info here
check
check --timeout 0 mass.fmu
check --timeout soon mass.fmu
check mass.fmu missing.fmu here /dev/null
report nothing
report ran --out here
report ran --out ran/run.json
run helix_hand
run helix_handover -p alfa=0.2
run helix_handover -p alpha=7
run helix_handover --unit servo=dls.DampedLeastSquares
run ir_grasp -p "scene.p_WO_0=0.01 0.02"
run helix_handover -p ball_mass=1
run helix_handover --seed -1
run ir_grasp -p run_up=0 -p standoff=0 -p perturbed=false -p thing=paper_box_a
run helix_handover --unit arms=x.fmu
run helix_handover --unit arm
run helix_handover --unit arm=a.fmu --unit arm=b.fmu
run helix_handover --unit arm=missing.fmu
run helix_handover --unit arm=here
run helix_handover --unit arm=cut.fmu
run helix_handover --unit arm=unclosed.fmu
run helix_handover --unit arm=hand.fmu
run helix_handover --unit arm=TendonArmFst
run helix_handover --out a
run helix_handover --out ""
run ir_grasp --step 1
run ir_grasp --start 0
run ir_grasp --stop 0
run ir_grasp --stop -1
run ir_grasp --stop 1e308
run ir_grasp --checkpoint 1e-308
run two.ssp --stop 1e308
run ir_grasp --input u.csv
run ir_grasp --isolate hand
run ir_grasp --seed 3.5
run ir_grasp --pace nan
run ir_grasp --call-limit inf
run here/mas.fmu
run here/mass
run here/none.ssd
run here/notes.txt
run own_reach.py
run own_reach
list own_reach.py
build own_reach.py
run nowhere/mass
run mass.fmuu
run here
run ran
run a
run x.ssp --input u.csv
run missing.ssp
run broken.ssp
resume here
resume nothing
resume a
run two.ssp
run two.ssp --stop 2 --unit a=1 --seed 3
run two.ssp --stop 2 --start 2
run two.ssp --stop 2 -p left.mas=1 -p m=1
run two.ssp --stop 2 -p left.m=soon
run two.ssp --stop 2 -p left.m
run mass.fmu -p mas=1
run mass.fmu -p m
run mass.fmu -p m=heavy
run mass.fmu -p m=1 -p m=2
run mass.fmu -p m=1,2
run mass.fmu -p m=inf
run mass.fmu --input missing.csv
run mass.fmu --seed 1
run mass.fmu --unit a=b.fmu
run mass.fmu --record arm.x
run mass.fmu --record x
run mass.fmu --record k
list mass.fmu
run mass.fmu --record mass.z*
run mass.fmu --step 0
run mass.fmu --step soon
run mass.fmu --step 1/0
run mass.fmu --step 1e400
run mass.fmu --largest-step 1 --first-step 1
run mass.fmu --adaptive 0
run mass.fmu --adaptive 1e-3 --largest-step 1e-9
run mass.fmu --tolerance inf
run mass.fmu --repeat-discarded --extrapolation linear
run mass.fmu --algorithm gauss
run mass.fmu --iterations 0
run clerk.fmu --start 1
run clerk.fmu --start 3 --stop 2
run clerk.fmu --unit-tolerance 0
run clerk.fmu --unit-tolerance clerk=
run clerk.fmu --unit-tolerance =1e-3
run clerk.fmu --unit-tolerance clerk=nan
run turned.fmu --step 0.1
build TendonArms
build spring
build nowhere:Spring
build own_broken:Spring
build support.scenarios.tearing_spring:Nothing
build support.scenarios.tearing_spring:Spring --step soon
build support.scenarios.tearing_spring:Spring --step 1e-400
build support.scenarios.tearing_spring:Inputs
build Push --step 0.1
build StereoCamera --fmi 2
build Push --stimulus given.csv
build --prove --stimulus given.csv
build Push Thrusters --prove --stimulus a.csv
build Push --prove --stimulus given.csv
build Push --out file
build Push --out file/x
export ir_gasp --ssp a.ssp
export IrReflex --ssp a.ssp
export ir_grasp
export ir_grasp --ssp a.zip
export ir_grasp --ssp two.ssp
export ir_grasp --ssp file/a.ssp
export ir_grasp --ssp folder.ssp
export ir_grasp --ssp a.ssp -p standof=1
export ir_grasp --ssp a.ssp -p strategy=backward
export ir_grasp --ssp a.ssp --unit reflex=missing.fmu
export ir_grasp --ssp a.ssp --unit reflexes=a.fmu
export mass.fmu --ssp a.ssp
sweep ir_gasp
sweep my_plan.toml
sweep x.ssp
sweep x.fmu a=1,2
sweep x.fmu --seed 3 --unit a=b
sweep ir_grasp --step 0.1
sweep ir_grasp seed=1,2
sweep ir_grasp --isolate hand
sweep ir_grasp shift_least=0.01,0.06
sweep ir_grasp -p strategy=reflex,blind
sweep ir_grasp --unit sceen=x.fmu
sweep ir_grasp --unit scene=absent.fmu
sweep ir_grasp --unit reflex=hand.fmu
sweep ir_grasp --workers 2 --scheduler tcp://h:1
sweep ir_grasp --workers 0
sweep ir_grasp --repeat 0
sweep ir_grasp --first-step 0.1
sweep ir_grasp --config none.toml
paper ir-tabel
paper ir-table --workers 2 --scheduler tcp://127.0.0.1:1
paper ir-table --model m.json
paper vsl-2 --model none.json
paper ir-table --quick --out here
compare a
compare a absent --name x
compare a b --signal scene.yaw
compare a b --metric mowed
compare a ran
compare a b --out a
study report planned
study export planned
study withdraw planned P01
study serve planned/plan.toml --out planned
study report study --out study/plan.toml
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of files and folders that calls name."""
    place = tmp_path_factory.mktemp("usage")
    for name in ("here", "ran", "folder.ssp", "planned"):
        (place / name).mkdir()
    for name in ("file", "here/mass.fmu", "here/notes.txt"):
        (place / name).touch()
    (place / "ran" / "run.json").write_text('{"scenario": "ir_grasp", "parameters": {}}')
    code = "class Spring:\n    def step(self): ...\nclass Reach:\n    def build(self): ...\n"
    (place / "own_reach.py").write_text(code)
    (place / "own_broken.py").write_text("x = 1\ny = 1 / 0\n")
    for name in ("a", "b"):
        folder_of(place / name, campaign_metadata("ir_grasp", [{}]), table_of([{}], moved=[0.1, 0.2]))
    (place / "planned" / "plan.toml").write_text(default_plan(), encoding="utf-8")
    StudyFolder.opened(place / "study", PLAN)
    two = System()
    for name in ("left", "right"):
        two.add(name, native_fmu("mass", 2))
    write_ssp(two, place / "two.ssp", "two masses")
    for name, file in (("mass", native_fmu("mass", 2)), ("clerk", native_fmu("clerk", 2))):
        shutil.copyfile(file, place / f"{name}.fmu")
    shutil.copyfile(cached("HandoverPartner", 3), place / "hand.fmu")
    (place / "cut.fmu").write_bytes((place / "mass.fmu").read_bytes()[:500])
    write_archive(place / "unclosed.fmu", {"modelDescription.xml": b"<fmiModelDescription"})
    write_archive(place / "broken.ssp", {"SystemStructure.ssd": b"<ssd:System"})
    turned = native_fmu("clerk", 3)
    described_otherwise(turned, place / "turned.fmu", lambda text: text.replace('startTime="0"', 'startTime="2"'))
    return place


@pytest.mark.parametrize("line", CALLS.strip().splitlines())
def test_a_usage_error_is_reported_and_leaves_nothing(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = {path for path in folder.rglob("*") if "__pycache__" not in path.parts}
    wording.check(refusal(*shlex.split(line)).replace(str(folder), "HERE"))
    assert {path for path in folder.rglob("*") if "__pycache__" not in path.parts} == before
