"""The parts of the evidence: command, what it shows, how long it takes."""

from dataclasses import dataclass

PEERS = ".cache/peers/bin/python"


@dataclass(frozen=True)
class Part:
    """One command that prints one JSON object.

    Parameters
    ----------
    name : str
        Name of the part and of its result file.
    command : str
        As typed from the root of the checkout; `python` is the interpreter of this environment.
    shows : str
        What the result is evidence of.
    minutes : float
        How long it takes on an idle machine of two cores, about.
    """

    name: str
    command: str
    shows: str
    minutes: float


PARTS = (
    Part(
        "linear_law_tables",
        "python -m tools.studies.linear_law_tables --json",
        "margins of the linear laws, passive optimum, printed laws and their index",
        1,
    ),
    Part(
        "nonlinear_law_tables",
        "python -m tools.studies.nonlinear_law_tables --json",
        "feedback linearization, valves and stimulation",
        5,
    ),
    Part(
        "share_of_possible",
        "python -m tools.studies.share_of_possible --seeds 8 --json",
        "roll in the storm hour beside the clairvoyant bound",
        6,
    ),
    Part(
        "many_seas",
        "python -m tools.studies.many_seas --seconds 900 --seeds 3 --json",
        "shares of the possible in many seas, headings and loadings, beside the causal bound",
        15,
    ),
    Part(
        "renewed_seas",
        "python -m tools.studies.renewed_seas --seeds 3 --json",
        "the law that starts knowing nothing, 20 minutes on, in many seas on the bench's plant",
        30,
    ),
    Part(
        "constrained_campaign",
        "python -m tools.studies.constrained_campaign --seeds 8 --out docs/pictures --json",
        "constrained and self-tuned GPC against the same clipped, sea by sea, with its picture",
        25,
    ),
    Part(
        "sea_estimates",
        "python -m tools.studies.sea_estimates --hours 3 --json",
        "what the motion tells of waves, load and stability, against the truth",
        30,
    ),
    Part(
        "renewed_voyage",
        "python -m tools.studies.renewed_voyage --json",
        "the self-tuned law renewed through a sea and a load that change, both ways",
        8,
    ),
    Part(
        "forecast_errors",
        "python -m tools.studies.forecast_errors --seeds 8 --json",
        "how far ahead predictors see the roll, by their sea",
        5,
    ),
    Part(
        "model_errors",
        "python -m tools.studies.model_errors --seeds 8 --json",
        "the shipped laws on a ship other than the one they were designed for",
        20,
    ),
    Part(
        "february_hours",
        "python -m tools.evidence.campaign_part configs/studies/february_hours.yaml",
        "the self-tuning law in all ninety-nine measured hours, three seeds each: roll and energy",
        80,
    ),
    Part(
        "storm_seeds",
        "python -m tools.evidence.campaign_part configs/studies/storm_seeds.yaml",
        "every law on the bench over sixteen hours of the storm",
        30,
    ),
    Part(
        "shipped_scenarios",
        "python -m tools.evidence.campaign_part configs/studies/shipped_scenarios.yaml",
        "the shipped scenarios on the bench, beside the linear plant",
        10,
    ),
    Part(
        "campaign_kills",
        "python -m tools.studies.campaign_kills --json",
        "a campaign whose workers and driver are killed, and what a case costs on one and two",
        40,
    ),
    Part(
        "year_of_seas",
        "python -m tools.evidence.campaign_part configs/studies/year_of_seas.yaml",
        "a year of seas for the first ship and the laws of the storm: roll, power, worst hour",
        30,
    ),
    Part(
        "starter_ships",
        "python -m tools.studies.starter_ships --json",
        "from a ship's dimensions to the bench: tank, pump and law of `utank-hil init`",
        3,
    ),
    Part(
        "false_alarms",
        "python -m tools.studies.false_alarms --hours 50 --json",
        "rate of false alarms of the monitors: every law, calm to storm, voyages and retuning",
        1200,
    ),
    Part(
        "twin_errors",
        "python -m tools.studies.twin_errors --json",
        "the passive ship beside the twin where a law came nearest to ROLL_AMPLIFIED",
        8,
    ),
    Part(
        "fault_campaign",
        "python -m firmware_sim.commands.faults --seeds 100 --json",
        "every fault of the table in a hundred seas: found in time, zero in time",
        20,
    ),
    Part(
        "fault_campaign_roll",
        "python -m firmware_sim.commands.faults --seeds 10 --full --json",
        "every fault of the table in ten seas, with those that take minutes: roll over 600 s",
        20,
    ),
    Part(
        "monitor_margins",
        "python -m tools.studies.monitor_margins configs/scenarios/storm_all.yaml --minutes 60"
        " --json",
        "how near the monitors come to a false alarm in the storm's hour, law by law",
        10,
    ),
    Part(
        "identification_bound",
        "python -m tools.studies.identification_bound --json",
        "identification in a storm against the Cramer-Rao bound",
        5,
    ),
    Part(
        "retuned_load_change",
        "python -m tools.studies.retuned_voyages configs/scenarios/load_change.yaml"
        " --seeds 1 2 3 --json",
        "what retuning is worth when the load changes",
        10,
    ),
    Part(
        "thesis_capsize",
        "python -m tools.thesis.capsize_study --json",
        "capsizing: thresholds and probability",
        5,
    ),
    Part(
        "thesis_figures",
        "python -m tools.thesis --json",
        "every figure and printed number of the source, and what its text says of them",
        4,
    ),
    Part(
        "thesis_derivation",
        "python -m tools.thesis.derive_tank_forces --json",
        "every printed term of the tank's forces that differs from the derivation",
        1,
    ),
    Part(
        "cost_campaign",
        "python -m tools.benchmarks.campaign --json",
        "what a case of a campaign costs: duration, order, horizon, nodes, number of cases",
        2,
    ),
    Part(
        "cost_codec",
        "python -m tools.benchmarks.codec --json",
        "cost of a frame against cantools",
        1,
    ),
    Part(
        "cost_controllers",
        "python -m tools.benchmarks.controllers --steps 5000 --json",
        "cost of a step of each controller",
        1,
    ),
    Part(
        "cost_dynamics",
        "python -m tools.benchmarks.dynamics --json",
        "speed of the nonlinear model against C, scipy and python-control",
        3,
    ),
    Part(
        "cost_identification",
        "python -m tools.benchmarks.identification --json",
        "speed, memory and growth of identification",
        3,
    ),
    Part(
        "cost_lockstep",
        "python -m tools.benchmarks.lockstep --json",
        "cost of the lockstep runner alone",
        1,
    ),
    Part(
        "cost_monitors",
        "python -m tools.benchmarks.monitors --minutes 5 --json",
        "cost of each monitor in a tick: in the loop, and by itself",
        1,
    ),
    Part(
        "cost_realtime",
        "python -m tools.benchmarks.realtime --seconds 200 --json",
        "lateness of the real-time loop against a bare sleep: alone, under load, while retuning",
        20,
    ),
    Part(
        "cost_retuning",
        "python -m tools.benchmarks.retuning --turns 8 --json",
        "overruns of the loop with and without retuning",
        15,
    ),
    Part(
        "cost_slice",
        "python -m tools.benchmarks.slice --json",
        "the whole slice in lockstep: ship seconds per second",
        1,
    ),
    Part(
        "cost_telemetry",
        "python -m tools.benchmarks.telemetry --json",
        "ring and recording",
        1,
    ),
    Part(
        "peers_bound_solvers",
        f"{PEERS} -m tools.peers.compare_bound_solvers --seconds 3600 --json",
        "the clairvoyant bound's programme in other sparse solvers",
        10,
    ),
    Part(
        "peers_identification",
        f"{PEERS} -m tools.peers.compare_identification --seeds 10 --json",
        "identification beside published packages",
        30,
    ),
    Part(
        "peers_plan_solvers",
        f"{PEERS} -m tools.peers.compare_plan_solvers --seconds 240 --json",
        "a step of the constrained law beside other solvers and do-mpc",
        5,
    ),
    Part(
        "mutation",
        "python -m tools.mutation.run --json",
        "every small change of the safety code against its tests: what lives, and why",
        90,
    ),
    Part(
        "coverage",
        "python -m tools.mutation.coverage --json",
        "every line and branch of the safety code is run by the tests that mirror it",
        2,
    ),
    Part(
        "fuzz_frames",
        "python -m tools.fuzz.frames --frames 10000000 --json",
        "random and mutated frames at the controller node and the drive",
        8,
    ),
    Part(
        "fuzz_configurations",
        "python -m tools.fuzz.configurations --number 10000 --laws --json",
        "mutated configurations: accepted, or refused with their place",
        10,
    ),
    Part(
        "week",
        "python -m tools.studies.week --days 7 --json",
        "a week in lockstep with load changes, retunings and faults: memory, handles, tick cost",
        120,
    ),
    Part(
        "tests",
        "python -m tools.evidence.pytest_part -n auto -m 'evidence and not socketcan'",
        "the tests that take minutes: statistics over many seeds, long voyages",
        10,
    ),
    Part(
        "tests_on_vcan",
        "tools/vcan python -m tools.evidence.pytest_part -m evidence tests/socketcan"
        " --ignore tests/socketcan/test_service.py",
        "on a real CAN bus, on an idle machine: retuning of order 200 from 500 s, kills, flaps",
        60,
    ),
    Part(
        "service",
        "tools/vcan --uml python -m tools.evidence.pytest_part -m evidence"
        " tests/socketcan/test_service.py",
        "the service on a booted systemd: starts, is watched, starts again, never arms",
        4,
    ),
)
