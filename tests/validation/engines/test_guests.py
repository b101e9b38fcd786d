"""Engines outside.

What they answer is judged as anybody's, and whatever they do costs their own rows
alone.
"""

import re
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial

import pytest

import fourbar
from fourbar.effects.place import Place
from fourbar.errors import InputError
from fourbar.files import save
from fourbar.scene.motion import Free
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES
from fourbar_validation.engines import guests, processes
from fourbar_validation.engines.registry import ENGINES, load_further
from fourbar_validation.run.judge import judge
from fourbar_validation.run.plan import Plan, RunOptions
from fourbar_validation.run.request import Request, select_engines
from fourbar_validation.run.run import run
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.guests import end_guests, list_processes, write_program
from tests.support.here import Heard, judge_here
from tests.support.scenes import crank_rocker
from tests.whole.test_imports import ROOT

HERE = "tests.support.hostile_class:"


def place_of(text):
    """The file and the line of the hostile class that has a text."""
    file = ROOT / "tests" / "support" / "hostile_class.py"
    lines = file.read_text(encoding="utf-8").splitlines()
    (number,) = (i for i, line in enumerate(lines, 1) if text in line)
    return f"({file}, line {number})"


TORQUE = '"torque": moments[0] - cross(r2, F32)'
SCRIPT = ROOT / "tests" / "support" / "plain_engine.mjs"
SCENE = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0), loads=())
FREE_BODY = tuple(engine for engine in ENGINES if engine.name == "free-body")
Verdicts = dict[str, dict[str, tuple[str, str]]]


@pytest.fixture(autouse=True)
def _ended():
    yield
    end_guests()


def judged(scene, *entries, seconds=60.0):
    """Verdict and reason by engine and quantity.

    A name without a colon is a class of tests.support.
    """
    entries = tuple(
        entry if re.search("[: ]", entry) else HERE + entry for entry in entries
    )
    engines = (
        *guests.read_guests(entries, [engine.name for engine in FREE_BODY], seconds),
        *FREE_BODY,
    )
    by_engine: Verdicts = {}
    for row in judge("scene", scene, engines).rows:
        by_engine.setdefault(row.engine, {})[row.quantity] = row.verdict, row.reason
    return by_engine


def verdicts(rows):
    return {verdict for verdict, _ in rows.values()}


def others_agree(by_engine):
    return (
        verdicts(by_engine["formulas"]) == verdicts(by_engine["free-body"]) == {AGREES}
    )


@pytest.mark.parametrize("language", ["python", "node"])
def test_a_program_in_any_language_agrees(language, tmp_path):
    if language == "node" and shutil.which("node") is None:
        pytest.skip("no node")
    rows = judged(
        SCENE,
        f"node {SCRIPT}" if language == "node" else write_program(tmp_path, "plain"),
    )["plain"]
    assert verdicts(rows) == {AGREES}
    assert {"theta_3", "theta_4", "torque", "torque_inertia", "closure"} <= rows.keys()


LAST = '    print(json.dumps({"id": question["id"], **reply}), flush=True)\n'
AFTER_HELLO = (
    '    if question["ask"] == "hello":\n    '
    + LAST
    + "        continue\n    import os, signal, time\n"
)
ANSWERS = '{\n            "answers": {name'
WHOLE = '    text = json.dumps({"id": question["id"], **reply})\n'
SAY = "    print(text, flush=True)\n"
NO_JSON, ENDLESS = (
    "said what is no JSON",
    "    while True:\n        print(end='x' * 2**20)\n",
)
PROGRAMS: dict[str, tuple[str, str, str]] = {
    "one number short": (
        "values in solved]",
        "values in solved[1:]]",
        "entries of answers.theta_3 = 8: must be a list of 9 numbers",
    ),
    "log line": (
        "for question in",
        'print("started")\nfor question in',
        f"{NO_JSON} (Expecting value",
    ),
    "dead": (LAST, f"{AFTER_HELLO}    sys.exit(3)\n", "exit status 3"),
    "another hello": (
        '["gravity"]}',
        '["gravity"], "version": str(__import__("os").getpid())}',
        "the engine's hello changed",
    ),
    "raises": (
        LAST,
        f"{AFTER_HELLO}    1 / 0\n",
        "exit status 1: ZeroDivisionError: division by zero (",
    ),
    "early": (LAST, LAST + LAST, "answered question 1 where 2 was asked"),
    "for another": (
        LAST,
        LAST.replace('question["id"],', 'question["id"] + 1,'),
        "answered question 2 where 1 was",
    ),
    "no id": (
        LAST,
        LAST.replace('"id": question["id"], ', ""),
        "said what is no object with an id",
    ),
    "a list": (
        LAST,
        "    print([1], flush=True)\n",
        "said what is no object with an id: [1]",
    ),
    "NaN": (TORQUE, '"torque": math.nan', f"{NO_JSON} (NaN is no number"),
    "1e400": (
        LAST,
        f"{WHOLE}    text = text.replace('0.33', '1e400')\n{SAY}",
        "answers.torque, entry ",
    ),
    "texts": (
        TORQUE,
        '"torque": "1.0"',
        "answers.torque, entry 0 = '1.0': must be a finite number or null",
    ),
    "booleans": (TORQUE, '"torque": theta > 2', "answers.torque, entry 0 = False"),
    "long integers": (TORQUE, '"torque": 10**400', "answers.torque, entry 0 = 1000"),
    "repeated key": (
        LAST,
        f"{WHOLE}    text = text[:-1] + ', \"id\": 1}}'\n{SAY}",
        f"{NO_JSON} (a key",
    ),
    "another code": (
        LAST,
        (
            f"{AFTER_HELLO}    sys.stdout.buffer.write(b'\\xff\\n')\n   "
            " sys.stdout.flush()\n"
        ),
        NO_JSON,
    ),
    "empty refusal": (
        ANSWERS,
        f'{{"refusal": " "}} or {ANSWERS}',
        "refusal = ",
    ),
    "own words": (
        ANSWERS,
        f'{{"error": "no\\nlicence"}} or {ANSWERS}',
        "no licence",
    ),
    "mid-line": (
        LAST,
        f"{WHOLE}    print(end=text[:20])\n    sys.exit()\n",
        "exit status 0 in the middle of a line",
    ),
    "closes": (
        LAST,
        f"{AFTER_HELLO}    os.close(1)\n    time.sleep(60)\n",
        "closed its standard output",
    ),
    "endless": (LAST, ENDLESS, "said more than 1000000 bytes without an end"),
    "eats memory": (
        LAST,
        f"{AFTER_HELLO}    x = [b'x' * 10**6 * i for i in range(999)]\n",
        "exit status 1: MemoryEr",
    ),
    "kills itself": (LAST, f"{AFTER_HELLO}    os.kill(os.getpid(), 9)\n", "was killed"),
    "crashes": (
        LAST,
        f"{AFTER_HELLO}    os.kill(os.getpid(), 11)\n",
        "ended by signal 11",
    ),
}
"""Replacement in the plain engine, and the reason of its row."""
SILENT: dict[str, tuple[str, str]] = {
    "silent": (LAST, f"{AFTER_HELLO}    time.sleep(1000)\n"),
    "ignores termination": (
        LAST,
        f"{AFTER_HELLO}    signal.signal(15, signal.SIG_IGN)\n    time.sleep(1000)\n",
    ),
    "floods its errors": (
        LAST,
        f"{AFTER_HELLO}    while True: print('x' * 2**20, file=sys.stderr)\n",
    ),
}
KILLS_ITS_PARENT = (LAST, f"{AFTER_HELLO}    os.kill(os.getppid(), 9)\n")
FINE: dict[str, tuple[str, str]] = {
    "byte by byte": (
        LAST,
        f"{WHOLE}    for c in text + chr(10): print(end=c, flush=True)\n",
    ),
    "patches the clock": (
        LAST,
        f"    import time; time.time = time.monotonic = lambda: 0.0\n{LAST}",
    ),
    "deaf": (
        LAST,
        f"{LAST}    if question['ask'] == 'answer': import os; os.close(2)\n",
    ),
}


@pytest.mark.parametrize(
    ("errors", "line"),
    [
        (
            (
                "node:internal/modules/cjs/loader:1145\n  throw err;\n  ^\n\n"
                "Error: Cannot find module '/x.js'\n    at Module._load (node:1)\n"
                "  code: 'MODULE_NOT_FOUND'\n}\n\nNode.js v20.11.0\n"
            ),
            "Error: Cannot find module '/x.js'",
        ),
        (
            (
                "Traceback (most recent call last):\n  File 'x', line 1\n"
                "ModuleNotFoundError: No module named 'sim'\n"
            ),
            "ModuleNotFoundError: No module named 'sim'",
        ),
        (
            (
                'Exception in thread "main" java.lang.IllegalStateException: no'
                " licence\n\tat Main.main(Main.java:5)\n"
            ),
            'Exception in thread "main" java.lang.IllegalStateException: no licence',
        ),
        (
            (
                "terminate called after throwing an instance of 'std::runtime_error'\n"
                "  what():  model not found\nAborted\n"
            ),
            "what():  model not found",
        ),
        ("loading\nsh: 1: simulate: not found\n", "sh: 1: simulate: not found"),
        ("one\ntwo\n", "two"),
        ("", ""),
    ],
)
def test_the_reason_of_a_dead_program_is_the_line_that_says_why(errors, line):
    assert processes.find_reason(errors) == line


def test_a_torque_that_is_a_thousandth_off_fails_alone(tmp_path):
    by_engine = judged(
        SCENE,
        write_program(
            tmp_path, "off", (TORQUE, '"torque": 1.001 * (moments[0] - cross(r2, F32))')
        ),
    )
    assert {
        name for name, (verdict, _) in by_engine["off"].items() if verdict == FAILS
    } == {"torque", "torque_inertia"}
    assert others_agree(by_engine)


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.timeout(300)
def test_whatever_a_program_does_costs_its_own_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "WORKER_MEMORY", 2 * 10**8)
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    entries = {}
    for name, (old, new, _) in PROGRAMS.items():
        entries[name] = write_program(tmp_path, name, (old, new))
    fine = {name: write_program(tmp_path, name, pair) for name, pair in FINE.items()}
    by_engine = judged(SCENE, *entries.values(), *fine.values())
    assert others_agree(by_engine)
    for name in fine:
        assert verdicts(by_engine[name]) == {AGREES}, (name, by_engine[name])
    for name, (_, _, reason) in PROGRAMS.items():
        rows = by_engine[
            name if name in by_engine else name.replace(" ", "_")
        ]  # of one whose hello fails the file's name
        ((verdict, said),) = [
            row for quantity, row in rows.items() if quantity == "all"
        ]
        assert verdict == FAILS and said.startswith(reason) and "\n" not in said, (
            name,
            rows,
        )
    end_guests()
    assert not list_processes(f"MARK_OF_TEST={tmp_path}")


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.timeout(120)
def test_a_program_that_is_silent_ends_at_its_limit(tmp_path, monkeypatch):
    """With what it started, and is not asked again for that scene."""
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    monkeypatch.setattr(processes, "MOST_ERRORS", 10**7)
    entries = [write_program(tmp_path, name, pair) for name, pair in SILENT.items()]
    began = time.monotonic()
    by_engine = judged(SCENE, *entries, seconds=3.0)
    assert time.monotonic() - began < 60.0 and others_agree(by_engine)
    for name in ("silent", "ignores termination"):
        assert by_engine[name] == {"all": (FAILS, "no answer within 3 s")}
    assert by_engine["floods its errors"]["all"][1].startswith(
        ("wrote more than", "no answer within")
    )
    assert not list_processes(f"MARK_OF_TEST={tmp_path}")


@pytest.mark.linux
def test_what_is_killed_from_outside_is_asked_again(tmp_path):
    """Once."""
    lives = tmp_path / "lives"
    lives.write_text("x")
    body = f"    n = os.path.getsize({str(lives)!r})\n"
    body += f"    if n: os.truncate({str(lives)!r}, n - 1); os.kill(os.getpid(), 9)\n"
    by_engine = judged(
        SCENE, write_program(tmp_path, "unlucky", (LAST, AFTER_HELLO + body + LAST))
    )
    assert verdicts(by_engine["unlucky"]) == {AGREES} and not lives.stat().st_size


@pytest.mark.slow
def test_a_class_is_served_by_our_host():
    classes = "Right Angle Changes Prints Empty Leaves Lacks Shapes Elsewhere Complex"
    by_engine = judged(SCENE, *classes.split())
    assert others_agree(by_engine) and verdicts(by_engine["right"]) == {AGREES}
    assert by_engine["right"].keys() >= {
        *fourbar.quantities.UNKNOWNS,
        "assembled",
        "closure",
        "torque_inertia",
    }
    assert set(by_engine["angle"]) == {
        "assembled",
        "theta_3",
        "undecided",
    } and verdicts(by_engine["angle"]) == {AGREES}
    failing = {
        name: {quantity for quantity, row in rows.items() if row[0] == FAILS}
        for name, rows in by_engine.items()
    }
    assert failing["changes"] == {"torque"}
    assert failing["lacks"] == {"theta_4", "torque", "closure", "torque_inertia"}
    reasons = {
        name: rows["all"][1] for name, rows in by_engine.items() if "all" in rows
    }
    assert reasons == {
        "prints": f"ValueError: no licence {place_of('licence')}",
        "empty": "TypeError: the answer is a NoneType, not a fourbar_validation.Answer",
        "leaves": f"SystemExit: 0 {place_of('sys.exit(0)')}",
        "complex": "TypeError: an answer holds real numbers, not complex128",
        "shapes": "entries of answers.F12 = 2: must be a list of 9 pairs [x, y], null "
        "where there is no value",
        "elsewhere": "at.omega_2: must be within 1 of the command",
    }


@pytest.mark.slow
def test_a_guest_is_asked_for_what_its_hello_names(tmp_path):
    four = crank_rocker(
        motion=fourbar.Motion(theta_4=fourbar.Sweep(1.8, 2.5, 8), omega_4=3.0)
    )
    three = crank_rocker(
        motion=fourbar.Motion(theta_3=fourbar.Sweep(0.4, 0.8, 8), omega_3=3.0)
    )
    stroke = fourbar.Motion(
        stroke=fourbar.Sweep(0.25, 0.35, 8),
        stroke_speed=0.2,
        side="left",
    )
    drive = fourbar.LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4)))
    for scene in (four, crank_rocker(motion=stroke, drive=drive)):
        by_engine = judged(scene, "OfAnyBar", "Right")
        assert (
            verdicts(by_engine["of any bar"]) == {AGREES}
            and {"theta_3", "alpha_4", "F12"} <= by_engine["of any bar"].keys()
        )
        assert (
            by_engine["right"].keys() == {"all"}
            and by_engine["right"]["all"][0] == REFUSES
        )
    assert judged(three, "OfAnyBar")["of any bar"]["all"][0] == REFUSES
    loaded = judged(crank_rocker(), write_program(tmp_path, "plain"))["plain"]
    assert loaded["all"] == (
        REFUSES,
        "the engine's hello does not list loads in effects",
    )


def test_a_guest_of_protocol_3_is_not_asked_for_springs_that_act_one_way():
    """Its hello names springs alone: those that act both ways it is asked as before."""
    program = guests.Program(("none",))
    hello = guests.Hello("sprung", effects=("springs",))
    client = guests.GuestClient("sprung", program, hello)
    ends = Place(1, (0.1, 0.5)), Place(2, (0.1, 0.0))
    said = []
    for acts in (None, "push"):
        spring = fourbar.Spring(*ends, 200.0, 0.05, acts=acts)
        scene = crank_rocker(loads=(), effects=(fourbar.Springs((spring,)),))
        said.append(client._explain_refusal(guests._find_needs(scene)))
    assert said == ["", "the engine's hello does not list one_sided in effects"]


@pytest.mark.slow
def test_a_guest_that_integrates_is_asked_for_released_motions(monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr(
        "fourbar_validation.run.released.LONGEST_TIMESTEP", 1e-3
    )  # MuJoCo's here
    motion = fourbar.Motion(1.0, 2.0, free=Free(0.2, 10))
    by_engine = judged(crank_rocker(motion=motion, loads=()), "Releases", "Right")
    assert verdicts(by_engine["releases"]) <= {AGREES, DEGRADED} and verdicts(
        by_engine["right"]
    ) <= {AGREES, DEGRADED}
    assert {"theta_2", "omega_2", "energy", "F12"} <= by_engine["releases"].keys()
    assert "energy" not in by_engine["right"]
    assert {
        name: by_engine["releases"][name] for name in by_engine["mujoco-forward"]
    } == by_engine["mujoco-forward"]


@pytest.mark.parametrize(
    ("stated", "names"),
    [
        (["wg 1.2"], ["wg"]),
        (["wg 1.2", "wg 1.3"], ["wg 1.2", "wg 1.3"]),
        (["wg 1.2 released"], ["wg released"]),
        (["wg 1.2", "wg 1.2"], ["wg 1.2", "wg 1.2-2"]),
        (["free-body 2.0"], ["free-body 2.0"]),
        (["1.2"], ["1.2"]),
    ],
)
def test_a_version_stands_in_a_name_only_beside_another_one(stated, names):
    programs = [(one, "", guests.Program((one,))) for one in stated]
    hellos = {guests.Program((one,)): one for one in stated}

    def say_hello(program):
        name = hellos[program]
        (version,) = (word for word in name.split() if "." in word)
        return guests.Hello(name, version=version)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(guests, "ask_hello", say_hello)
        made = guests.name_guests(programs, ["free-body"])
    named = guests.name_by_versions(made, [*(one.name for one in made), "free-body"])
    assert [guest.name for guest in named] == names
    assert [guest.start().name for guest in named] == names


@pytest.mark.slow
def test_names_stand_apart():
    """Of another engine, of two guests, and of those whose hello fails.

    By entry, class or file.
    """
    entries = [
        HERE + "OfAnother",
        HERE + "Right",
        HERE + "Right",
        HERE + "Nameless",
        "false",
        "sh -c 'exit 3'",
    ]
    names = [guest.name for guest in guests.read_guests(entries, ["free-body"])]
    assert names == ["free-body-2", "right", "right-2", "Nameless", "false", "sh"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ("no such program", "the command line of a program that is there"),
        ("'", "is no command line"),
        ("no.such:Class", "ModuleNotFoundError"),
        (HERE + "Absent", "AttributeError"),
    ],
)
def test_what_is_not_there_is_refused_in_one_line(entry, part):
    with pytest.raises(InputError) as error:
        select_engines(Request(guest=(entry,)))
    assert (
        str(error.value).startswith("--guest = ")
        and part in str(error.value)
        and "\n" not in str(error.value)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "reason"),
    [("Nameless", "engine"), ("Loose", "tolerance"), ("Else", "answers")],
)
def test_a_hello_that_fails_is_one_failing_row(name, reason):
    by_engine = judged(SCENE, name)
    ((engine, rows),) = [
        item for item in by_engine.items() if item[0] not in ("formulas", "free-body")
    ]
    assert (
        others_agree(by_engine) and rows.keys() == {"all"} and rows["all"][0] == FAILS
    )
    assert engine == name and rows["all"][1].startswith(reason)


def command_line(out, *options):
    line = [
        sys.executable,
        "-m",
        "validation",
        "run",
        str(out / "scene.toml"),
        str(out / "second.toml"),
    ]
    line += [
        "--engines=free-body",
        "--workers=1",
        f"--out={out / 'out'}",
        "--no-pictures",
        *options,
    ]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_run_with_guests_ends_with_their_rows_and_none_of_their_processes(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    for name in ("scene", "second"):
        save(SCENE, tmp_path / f"{name}.toml")
    silent = write_program(tmp_path, "silent", SILENT["silent"])
    classes = [f"--guest={HERE}{name}" for name in ("Right", "Prints")]
    began = time.monotonic()
    done = command_line(
        tmp_path,
        "--time-limit=5",
        f"--guest={silent}",
        *classes,
    )
    assert done.returncode == 1 and time.monotonic() - began < 200.0, done.stderr
    assert "owned" not in done.stdout + done.stderr
    rows: dict[str, set[tuple[str, str]]] = {}
    for row in read_columns(tmp_path / "out" / "results.csv"):
        rows.setdefault(row.engine, set()).add(
            (row.verdict, row.reason if row.quantity == "all" else "")
        )
    for name in ("formulas", "free-body", "right"):
        assert rows[name] == {(AGREES, "")}, name
    assert rows["silent"] == {(FAILS, "no answer within 5 s")}
    raised = f"ValueError: no licence {place_of('licence')}"
    assert rows["prints"] == {(FAILS, f"{raised}; what it printed: output.txt")}
    text = (tmp_path / "out" / "output.txt").read_text()
    assert text.count("\\x1b]0;owned\\x07begin\nfrom a shell") == 2
    if sys.platform == "linux":
        time.sleep(2.0)
        assert not list_processes(f"MARK_OF_TEST={tmp_path}")


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.timeout(200)
def test_a_guest_that_kills_its_worker_turns_no_other_engine_red(tmp_path):
    kills = write_program(tmp_path, "kills its parent", KILLS_ITS_PARENT)
    plain = write_program(tmp_path, "plain")
    save(SCENE, tmp_path / "scene.toml")
    suite = read_scene_files([tmp_path / "scene.toml"])
    engines = (*FREE_BODY, *guests.read_guests([kills, plain], ["free-body"]))
    summary = run(Plan(suite, engines, RunOptions(1, drawn=False)), tmp_path / "out")
    rows = list(read_columns(tmp_path / "out" / "results.csv"))
    (failing,) = [row for row in rows if row.verdict == FAILS]
    assert failing.engine == "kills its parent"
    assert failing.reason.startswith("the engine crashed its process")
    for name in ("formulas", "free-body", "plain"):
        assert any(row.engine == name and row.verdict == AGREES for row in rows)
    assert summary.counts.status == 1


@pytest.mark.slow
def test_a_report_shows_the_versions_that_guests_state(tmp_path):
    stated = {"numpy-like": "", "own": "2.1", "own 3.0": "3.0"}
    hello = '["gravity"]}'
    entries = [
        write_program(tmp_path, name, (hello, f'["gravity"], "version": "{version}"}}'))
        for name, version in stated.items()
    ]
    save(SCENE, tmp_path / "scene.toml")
    suite = read_scene_files([tmp_path / "scene.toml"])
    plan = Plan(suite, guests.read_guests(entries, ()), RunOptions(drawn=False))
    summary = run(plan, tmp_path / "out")
    shown = {line.name: line.version for line in summary.engines if line.name in stated}
    assert shown == {"numpy-like": "", "own": "2.1", "own 3.0": ""}
    assert "| own 2.1 |" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")


NEAR = """
from fourbar_validation.engines.free_body import FreeBody

def answer(scene, at):
    answer = FreeBody().answer(scene, at)
    answer.quantities["torque"] = FACTOR * answer.quantities["torque"]
    return answer
"""


@pytest.mark.slow
def test_parts_judged_by_another_code_are_made_again(tmp_path, monkeypatch):
    """Runs that are interrupted once the first part is there.

    What the second one says of its parts.
    """
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "mine.py").write_text(
        "class Mine:\n    name = 'mine'\n    def answer(self, scene, at):\n"
        "        import near\n        return near.answer(scene, at)\n"
    )
    save(SCENE, tmp_path / "scene.toml")
    suite = read_scene_files((tmp_path / "scene.toml",))
    judge_here(monkeypatch)

    class Interrupting(Heard):
        def advance(self, stage, scenes):
            if any((tmp_path / "out" / "parts").iterdir()):
                raise KeyboardInterrupt

    def notes(entries):
        heard, engines = Interrupting(), guests.read_guests(entries, ())
        with pytest.raises(KeyboardInterrupt):
            plan = Plan(suite, engines, RunOptions(drawn=False))
            run(plan, tmp_path / "out", heard)
        return heard.lines

    program = write_program(tmp_path, "program")
    again = ["made again: the parts of another run (engines)"]
    kept = [
        "kept from an interrupted run: the answers of all engines on 1 of 1 scenes,"
        " scene"
    ]
    for factor, said in (("1.0", []), ("1.0", kept), ("1.01", again), ("1.01", kept)):
        (tmp_path / "near.py").write_text(NEAR.replace("FACTOR", factor))
        assert notes(["mine:Mine", program]) == said
    write_program(
        tmp_path, "program", (TORQUE, '"torque": 1.01 * (moments[0] - cross(r2, F32))')
    )
    assert notes(["mine:Mine", program]) == again


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine",
    [*ENGINES, *load_further()],
    ids=lambda engine: engine.name,
)
def test_our_own_adapters_answer_the_same_bytes_through_the_host(engine):
    if missing := engine.missing():
        pytest.skip(missing)
    program = guests.serve_adapter(engine.name, 120.0)
    start = partial(guests.GuestClient, engine.name, program, guests.ask_hello(program))
    outside = replace(engine, start=start)
    loaded = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0))
    stroke = fourbar.Motion(
        stroke=fourbar.Sweep(0.25, 0.35, 8),
        stroke_speed=0.2,
        side="left",
    )
    drive = fourbar.LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4)))
    theta_4 = fourbar.Motion(theta_4=fourbar.Sweep(1.8, 2.5, 8), omega_4=3.0)
    for scene in (
        loaded,
        SCENE,
        crank_rocker(motion=stroke, drive=drive),
        crank_rocker(motion=theta_4),
    ):
        inside = judge("scene", scene, (engine,), order=False).rows
        assert repr(judge("scene", scene, (outside,), order=False).rows) == repr(inside)
