"""Engines outside.

What they answer is judged as anybody's, and whatever they do costs their own rows
alone.
"""

import re
import shutil
import time
from collections import defaultdict

import numpy as np
from pytest import fixture, importorskip, mark, param, raises, skip

import fourbar
from fourbar import Motion, Place, Sweep
from fourbar_validation.compare.answer import explain_refusal
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES
from fourbar_validation.engines import guests, programs, registry
from fourbar_validation.run.command import Request, select_engines
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import FREE_BODY
from fourbar_validation.run.run import Plan, run
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.guests import (
    end_guests,
    hosted,  # noqa: F401 - a fixture
    list_processes,
    write_program,
)
from tests.support.here import Heard, judge_here
from tests.support.rows import read_rows, refused, slow_but
from tests.support.scenes import CYLINDER, crank_rocker
from tests.whole.test_imports import ROOT

HERE = "tests.support.hostile_class:"
FILE = ROOT / "tests/support/hostile_class.py"
TORQUE = '"torque": moments[0] - cross(r2, F32)'
OFF = (TORQUE, '"torque": 1.01 * (moments[0] - cross(r2, F32))')
SCRIPT = ROOT / "tests/support/plain_engine.mjs"
TURN = Motion(Sweep(0.1, 6.38, 8), 10.0)
SCENE = crank_rocker(TURN, loads=())
ROCKING = crank_rocker(Motion(theta_4=Sweep(1.8, 2.5, 8), omega_4=3.0))
STROKE = crank_rocker(
    Motion(stroke=Sweep(0.2, 0.3, 8), stroke_speed=0.2, side="left"),
    drive=CYLINDER,
)


in_a_host = mark.usefixtures("hosted")


def place_of(text):
    """The file and the line of the hostile class that has a text."""
    lines = FILE.read_text("utf-8").splitlines()
    (number,) = (i for i, line in enumerate(lines, 1) if text in line)
    return f"({FILE}, line {number})"


@fixture(autouse=True)
def _ended():
    yield
    end_guests()


@fixture
def sign(tmp_path, monkeypatch):
    """Marks the processes of a test, so that those that are left are found."""
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    return f"MARK_OF_TEST={tmp_path}"


@fixture
def suite(tmp_path):
    fourbar.save(SCENE, tmp_path / "scene.toml")
    return read_scene_files([tmp_path / "scene.toml"])


def judged(scene, *entries, seconds=60.0):
    """Verdict and reason by engine and quantity.

    A name without a colon is a class of tests.support.
    """
    entries = [entry if re.search("[: ]", entry) else HERE + entry for entry in entries]
    engines = (*guests.read_guests(entries, ["free-body"], seconds), FREE_BODY)
    by_engine = defaultdict(dict)
    for row in judge("scene", scene, engines).rows:
        by_engine[row.engine][row.quantity] = row.verdict, row.reason
    return by_engine


def verdicts(rows):
    return {verdict for verdict, _ in rows.values()}


def failing(rows):
    return {name for name, (verdict, _) in rows.items() if verdict == FAILS}


def others_agree(by_engine):
    others = [by_engine[name] for name in ("formulas", "free-body")]
    return all(verdicts(rows) == {AGREES} for rows in others)


@mark.parametrize("language", slow_but({"python"}, ["python", "node"]))
def test_a_program_in_any_language_agrees(language, tmp_path):
    if language == "node" and shutil.which("node") is None:
        skip("no node")
    in_node = language == "node"
    entry = f"node {SCRIPT}" if in_node else write_program(tmp_path, "plain")
    rows = judged(SCENE, entry)["plain"]
    assert verdicts(rows) == {AGREES}
    assert {"theta_3", "theta_4", "torque", "torque_inertia", "closure"} <= rows.keys()


LAST = '    print(json.dumps({"id": question["id"], **reply}), flush=True)\n'


def after_hello(*statements):
    """Run statements once hello is answered, in place of another answer."""
    lines = "".join(f"    {statement}\n" for statement in statements)
    return LAST, (
        f'    if question["ask"] == "hello":\n    {LAST}        continue\n'
        f"    import os, signal, time\n{lines}"
    )


def say(*statements):
    """Change the text of an answer, or how it is said."""
    whole = '    text = json.dumps({"id": question["id"], **reply})\n'
    return LAST, whole + "".join(f"    {statement}\n" for statement in statements)


ANSWERS = '{\n            "answers": {name'
SAY = "print(text, flush=True)"
NO_JSON = "said what is no JSON"
NO_ID = "said what is no object with an id"
PROGRAMS = {
    "one number short": (
        ("values in solved]", "values in solved[1:]]"),
        "entries of answers.theta_3 = 8: must be a list of 9 numbers",
    ),
    "log line": (
        ("for question in", 'print("started")\nfor question in'),
        f"{NO_JSON} (Expecting value",
    ),
    "dead": (after_hello("sys.exit(3)"), "exit status 3"),
    "another hello": (
        ('["gravity"]}', '["gravity"], "version": str(__import__("os").getpid())}'),
        "the engine's hello changed",
    ),
    "raises": (
        after_hello("1 / 0"),
        "exit status 1: ZeroDivisionError: division by zero (",
    ),
    "early": ((LAST, LAST + LAST), "answered question 1 where 2 was asked"),
    "for another": (
        (LAST, LAST.replace('question["id"],', 'question["id"] + 1,')),
        "answered question 2 where 1 was",
    ),
    "no id": ((LAST, LAST.replace('"id": question["id"], ', "")), NO_ID),
    "a list": (say("print([1], flush=True)"), f"{NO_ID}; it said: [1]"),
    "NaN": ((TORQUE, '"torque": math.nan'), f"{NO_JSON} (NaN is no number"),
    "1e400": (
        say("text = text.replace('0.33', '1e400')", SAY),
        "answers.torque, entry ",
    ),
    "a text in the third pair": (
        ("force.imag)", "force.imag if theta < 1.2 else 'y')"),
        "answers.F12, entry 2 = 'y': must be a finite number or null",
    ),
    "broken far inside": (
        say("text = '{\"a\": [' + 400 * '1, ' + '!' + 400 * ', 1' + ']}'", SAY),
        f"{NO_JSON} (Expecting value: line 1 column 1208 (char 1207)); it said: ... , "
        + 41 * "1, "
        + "!, 1, 1",
    ),
    "repeated key": (
        say("text = text[:-1] + ', \"id\": 1}'", SAY),
        f"{NO_JSON} (a key",
    ),
    "another code": (
        after_hello("sys.stdout.buffer.write(b'\\xff\\n')", "sys.stdout.flush()"),
        NO_JSON,
    ),
    "empty refusal": ((ANSWERS, f'{{"refusal": " "}} or {ANSWERS}'), "refusal = "),
    "own words": (
        (ANSWERS, f'{{"error": "no\\nlicence"}} or {ANSWERS}'),
        "no licence",
    ),
    "mid-line": (
        say("print(end=text[:20])", "sys.exit()"),
        "exit status 0 in the middle of a line",
    ),
    "closes": (after_hello("os.close(1)", "time.sleep(60)"), "closed its standard"),
    "endless": (
        say("while True: print(end='x' * 2**20)"),
        "said more than 1000000 bytes without an end",
    ),
    "eats memory": (
        after_hello("x = [b'x' * 10**6 * i for i in range(999)]"),
        "exit status 1: MemoryEr",
    ),
    "kills itself": (after_hello("os.kill(os.getpid(), 9)"), "was killed"),
    "crashes": (after_hello("os.kill(os.getpid(), 11)"), "ended by signal 11"),
}
"""Replacement in the plain engine, and the reason of its row."""
SILENT = {
    "silent": after_hello("time.sleep(1000)"),
    "ignores termination": after_hello(
        "signal.signal(15, signal.SIG_IGN)", "time.sleep(1000)"
    ),
    "floods its errors": after_hello("while True: print('x' * 2**20, file=sys.stderr)"),
}
FINE = {
    "byte by byte": say("for c in text + chr(10): print(end=c, flush=True)"),
    "patches the clock": say(
        "import time; time.time = time.monotonic = lambda: 0.0", SAY
    ),
    "deaf": say(SAY, "if question['ask'] == 'answer': import os; os.close(2)"),
}


@mark.parametrize(
    "errors, line",
    [
        (
            "node:internal/modules/cjs/loader:1145\n  throw err;\n  ^\n\n"
            "Error: Cannot find module '/x.js'\n    at Module._load (node:1)\n"
            "  code: 'MODULE_NOT_FOUND'\n}\n\nNode.js v20.11.0\n",
            "Error: Cannot find module '/x.js'",
        ),
        (
            "Traceback (most recent call last):\n  File 'x', line 1\n"
            "ModuleNotFoundError: No module named 'sim'\n",
            "ModuleNotFoundError: No module named 'sim'",
        ),
        (
            'Exception in thread "main" java.lang.IllegalStateException: no'
            " licence\n\tat Main.main(Main.java:5)\n",
            'Exception in thread "main" java.lang.IllegalStateException: no licence',
        ),
        (
            "terminate called after throwing an instance of 'std::runtime_error'\n"
            "  what():  model not found\nAborted\n",
            "what():  model not found",
        ),
        ("loading\nsh: 1: simulate: not found\n", "sh: 1: simulate: not found"),
        ("one\ntwo\n", "two"),
        ("", ""),
    ],
)
def test_the_reason_of_a_dead_program_is_the_line_that_says_why(errors, line):
    assert programs.find_reason(errors) == line


def test_a_torque_that_is_a_hundredth_off_fails_alone(tmp_path):
    by_engine = judged(SCENE, write_program(tmp_path, "off", *OFF))
    assert failing(by_engine["off"]) == {"torque", "torque_inertia"}
    assert others_agree(by_engine)


@mark.slow
@mark.linux
@mark.timeout(300)
def test_whatever_a_program_does_costs_its_own_rows(tmp_path, monkeypatch, sign):
    monkeypatch.setattr(programs, "WORKER_MEMORY", 2 * 10**8)
    replaced = {name: pair for name, (pair, _) in PROGRAMS.items()} | FINE
    entries = [write_program(tmp_path, name, *pair) for name, pair in replaced.items()]
    by_engine = judged(SCENE, *entries)
    assert others_agree(by_engine)
    for name in FINE:
        assert verdicts(by_engine[name]) == {AGREES}, (name, by_engine[name])
    for name, (_, reason) in PROGRAMS.items():
        # one whose hello fails has the name of its file
        rows = by_engine.get(name) or by_engine[name.replace(" ", "_")]
        verdict, said = rows["all"]
        assert verdict == FAILS and said.startswith(reason), (name, rows)
        assert "\n" not in said
    end_guests()
    assert not list_processes(sign)


@mark.slow
@mark.linux
@mark.timeout(120)
def test_a_program_that_is_silent_ends_at_its_limit(tmp_path, monkeypatch, sign):
    """With what it started, and is not asked again for that scene."""
    monkeypatch.setattr(programs, "MOST_ERRORS", 10**7)
    entries = [write_program(tmp_path, name, *pair) for name, pair in SILENT.items()]
    began = time.monotonic()
    by_engine = judged(SCENE, *entries, seconds=3.0)
    assert time.monotonic() - began < 60.0 and others_agree(by_engine)
    for name in ("silent", "ignores termination"):
        assert by_engine[name] == {"all": (FAILS, "no answer within 3 s")}
    said = by_engine["floods its errors"]["all"][1]
    assert said.startswith(("wrote more than", "no answer within"))
    assert not list_processes(sign)


@mark.linux
@mark.slow
def test_what_is_killed_from_outside_is_asked_again(tmp_path):
    """Once."""
    lives = tmp_path / "lives"
    lives.write_text("x")
    taken = f"os.truncate({str(lives)!r}, n - 1); os.kill(os.getpid(), 9)"
    old, dies = after_hello(f"n = os.path.getsize({str(lives)!r})", f"if n: {taken}")
    unlucky = write_program(tmp_path, "unlucky", old, dies + LAST)
    assert verdicts(judged(SCENE, unlucky)["unlucky"]) == {AGREES}
    assert not lives.stat().st_size


@mark.slow
def test_a_class_has_a_process_of_its_own():
    """One of them changes the judge's verdicts, where it can import it."""
    by_engine = judged(SCENE, "Right", "Changes")
    assert others_agree(by_engine) and verdicts(by_engine["right"]) == {AGREES}
    assert failing(by_engine["changes"]) == {"torque"}
    derived = {"assembled", "closure", "torque_inertia"}
    assert by_engine["right"].keys() >= {*fourbar.quantities.UNKNOWNS, *derived}


@in_a_host
def test_what_a_class_answers_or_raises_is_said_in_a_line():
    names = "Angle Prints Empty Leaves Lacks Shapes Elsewhere Complex"
    by_engine = judged(SCENE, *names.split())
    assert others_agree(by_engine)
    assert set(by_engine["angle"]) == {"assembled", "theta_3", "undecided"}
    assert verdicts(by_engine["angle"]) == {AGREES}
    lacking = {"theta_4", "torque", "closure", "torque_inertia"}
    assert failing(by_engine["lacks"]) == lacking
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


@in_a_host
@mark.parametrize("scene", [ROCKING, STROKE], ids=["bar 4", "stroke"])
def test_a_guest_is_asked_for_the_commands_that_its_hello_names(scene):
    by_engine = judged(scene, "OfAnyBar", "Right")
    rows = by_engine["of any bar"]
    assert verdicts(rows) == {AGREES} and {"theta_3", "alpha_4", "F12"} <= rows.keys()
    assert by_engine["right"].keys() == {"all"}
    assert by_engine["right"]["all"][0] == REFUSES


@in_a_host
def test_a_guest_is_not_asked_for_what_its_hello_leaves_out(tmp_path):
    motion = Motion(theta_3=Sweep(0.4, 0.8, 8), omega_3=3.0)
    assert judged(crank_rocker(motion), "OfAnyBar")["of any bar"]["all"][0] == REFUSES
    loaded = judged(crank_rocker(), write_program(tmp_path, "plain"))["plain"]
    refusal = "the engine's hello does not list loads in effects"
    assert loaded["all"] == (REFUSES, refusal)


@mark.parametrize("acts", [None, "push"])
def test_a_guest_of_protocol_3_is_not_asked_for_springs_that_act_one_way(acts):
    """Its hello names springs alone: those that act both ways it is asked as before."""
    hello = guests.Hello("sprung", effects=("springs",))
    client = guests.GuestClient("sprung", guests.Program(("none",)), hello)
    ends = Place(1, (0.1, 0.5)), Place(2, (0.1, 0.0))
    springs = fourbar.Springs(
        (
            fourbar.Spring(
                *ends,
                200.0,
                0.05,
                acts=acts,
            ),
        )
    )
    sprung = crank_rocker(loads=(), effects=(springs,))
    missing = "the engine's hello does not list one_sided in effects"
    assert client._explain_refusal(sprung) == (missing if acts else "")


@mark.slow
@in_a_host
def test_a_guest_that_integrates_is_asked_for_released_motions(monkeypatch):
    importorskip("mujoco")
    longest = "fourbar_validation.run.released.LONGEST_OF_A_GUEST"
    monkeypatch.setattr(longest, 1e-3)  # MuJoCo's here
    motion = Motion(1.0, 2.0, free=fourbar.Free(0.2, 10))
    by_engine = judged(crank_rocker(motion, loads=()), "Releases", "Right")
    released, right = by_engine["releases"], by_engine["right"]
    assert verdicts(released) | verdicts(right) <= {AGREES, DEGRADED}
    assert {"theta_2", "omega_2", "energy", "F12"} <= released.keys()
    assert "energy" not in right
    ours = by_engine["mujoco-forward"]
    assert {name: released[name] for name in ours} == ours


@mark.parametrize(
    "stated, names",
    read_rows("""
wg 1.2 | wg
wg 1.2, wg 1.3 | wg 1.2, wg 1.3
wg 1.2 released | wg released
wg 1.2, wg 1.2 | wg 1.2, wg 1.2-2
free-body 2.0 | free-body 2.0
formulas 2.0 | formulas 2.0
1.2 | 1.2
"""),
)
def test_a_version_stands_in_a_name_only_beside_another_one(stated, names, monkeypatch):
    programs = [(one, "", guests.Program((one,))) for one in stated.split(", ")]

    def say_hello(program):
        (name,) = program.command
        (version,) = (word for word in name.split() if "." in word)
        return guests.Hello(name, version=version)

    monkeypatch.setattr(guests, "ask_hello", say_hello)
    made = guests.name_guests(programs, ["free-body"])
    named = guests.name_by_versions(made, [*(one.name for one in made), "free-body"])
    assert ", ".join(guest.name for guest in named) == names
    assert ", ".join(guest.start().name for guest in named) == names


@in_a_host
def test_names_stand_apart():
    """Of another engine, of two guests, and of those whose hello fails.

    By entry, class or file.
    """
    classes = [HERE + name for name in ("OfAnother", "Right", "Right", "Nameless")]
    made = guests.read_guests([*classes, "false", "sh -c 'exit 3'"], ["free-body"])
    names = [guest.name for guest in made]
    assert names == ["free-body-2", "right", "right-2", "Nameless", "false", "sh"]


@mark.slow
@mark.parametrize(
    "entry, part",
    read_rows("""
no such program | the command line of a program that is there
' | is no command line
no.such:Class | ModuleNotFoundError
tests.support.hostile_class:Absent | AttributeError
"""),
)
def test_what_is_not_there_is_refused_in_one_line(entry, part):
    with refused(part, start="--guest = "):
        select_engines(Request(guest=(entry,)))


@in_a_host
@mark.parametrize(
    "name, reason",
    read_rows("""
Nameless | engine
Loose | tolerance
Else | answers
Misspelt | effects = 'spring': must be among gravity,
"""),
)
def test_a_hello_that_fails_is_one_failing_row(name, reason):
    by_engine = judged(SCENE, name)
    assert by_engine.keys() == {"formulas", "free-body", name}
    assert others_agree(by_engine)
    ((verdict, said),) = by_engine[name].values()
    assert verdict == FAILS and said.startswith(reason)


MINE = """
class Mine:
    name = "mine"

    def answer(self, scene, at):
        import near
        return near.answer(scene, at)
"""
NEAR = """
from fourbar_validation.engines.free_body import FreeBody

def answer(scene, at):
    answer = FreeBody().answer(scene, at)
    answer.quantities["torque"] = FACTOR * answer.quantities["torque"]
    return answer
"""


@mark.slow
def test_what_a_guest_prints_is_kept_beside_the_results(tmp_path, suite):
    printing = guests.read_guests([HERE + "Prints"], ())
    options = dict(workers=1, drawn=False)
    run(Plan(suite, printing, **options), tmp_path / "out")
    text = (tmp_path / "out" / "output.txt").read_text()
    assert "\\x1b]0;owned\\x07begin\nfrom a shell" in text


@mark.slow
def test_parts_judged_by_another_code_are_made_again(tmp_path, monkeypatch, suite):
    """Runs that are interrupted once the first part is there.

    What the second one says of its parts.
    """
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "mine.py").write_text(MINE)
    judge_here(monkeypatch)
    program = write_program(tmp_path, "program")

    class Interrupting(Heard):
        def advance(self, stage, scenes):
            if any((tmp_path / "out" / "parts").iterdir()):
                raise KeyboardInterrupt

    def run_once():
        heard, engines = Interrupting(), guests.read_guests(["mine:Mine", program], ())
        with raises(KeyboardInterrupt):
            run(Plan(suite, engines, drawn=False), tmp_path / "out", heard)
        return heard.lines

    again = ["made again: the parts of another run (engines)"]
    kept = [
        "kept from an interrupted run: the answers of all engines on 1 of 1 scenes,"
        " scene"
    ]
    for factor, said in (("1.0", []), ("1.0", kept), ("1.01", again)):
        (tmp_path / "near.py").write_text(NEAR.replace("FACTOR", factor))
        assert run_once() == said
    write_program(tmp_path, "program", *OFF)
    assert run_once() == again


SAME = ("setting", "assembled", "refusal", "alarms", "evidence", "quantities")
SAME += ("predicted",)


@in_a_host
@mark.parametrize(
    "engine",
    [
        param(engine, id=engine.name, marks=[mark.slow] * engine.through_time)
        for engine in (*registry.ENGINES, *registry.load_further())
    ],
)
def test_our_own_adapters_answer_the_same_bytes_through_the_host(engine):
    if missing := engine.missing():
        skip(missing)
    program = guests.serve_adapter(engine.name, 120.0)
    outside = guests.GuestClient(engine.name, program, guests.ask_hello(program))
    inside = engine.start()
    answered = 0
    scenes = [SCENE, crank_rocker(TURN)]
    if not engine.through_time:
        scenes += [STROKE, ROCKING]
    for scene in scenes:
        command = fourbar.command(scene)
        if explain_refusal(inside, command):
            continue
        ours, theirs = (
            registry.ask_at(one, scene, command) for one in (inside, outside)
        )
        for name in SAME:
            np.testing.assert_equal(getattr(theirs, name), getattr(ours, name), name)
        answered += 1
    assert answered >= 2
