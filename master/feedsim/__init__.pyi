"""The public names of feedsim, one a line: for type checkers, and for the package itself, which loads them lazily."""

from feedsim.analysis.evaluate import evaluate as evaluate
from feedsim.analysis.figures import Figure as Figure
from feedsim.files.trace import Trace as Trace
from feedsim.files.trace.files import read_trace as read_trace
from feedsim.foundation.errors import FeedsimError as FeedsimError
from feedsim.foundation.errors import Finding as Finding
from feedsim.foundation.errors import InputError as InputError
from feedsim.foundation.errors import OutputError as OutputError
from feedsim.foundation.errors import SimulationError as SimulationError
from feedsim.jobs.check import check as check
from feedsim.jobs.circle import circle as circle
from feedsim.jobs.compare import compare as compare
from feedsim.jobs.diff import diff as diff
from feedsim.jobs.export import export as export
from feedsim.jobs.frf import frf as frf
from feedsim.jobs.history import history as history
from feedsim.jobs.identify import identify_friction as identify_friction
from feedsim.jobs.identify_drive import identify_drive as identify_drive
from feedsim.jobs.identify_modes import identify_modes as identify_modes
from feedsim.jobs.identify_mounts import identify_mounts as identify_mounts
from feedsim.jobs.machine import machine_build as machine_build
from feedsim.jobs.machine import machine_info as machine_info
from feedsim.jobs.machine import machine_view as machine_view
from feedsim.jobs.machine_export import machine_export as machine_export
from feedsim.jobs.machine_import import machine_import as machine_import
from feedsim.jobs.replay import replay as replay
from feedsim.jobs.result import Made as Made
from feedsim.jobs.result import Result as Result
from feedsim.jobs.run import load as load
from feedsim.jobs.run import run as run
from feedsim.jobs.sweep import sweep as sweep
from feedsim.jobs.tools import convert as convert
from feedsim.jobs.tools import example as example
from feedsim.jobs.tools import schema as schema
from feedsim.jobs.tune_compensation import tune_compensation as tune_compensation
from feedsim.jobs.tune_drive import tune_drive as tune_drive
from feedsim.jobs.tune_drive import tune_proposals as tune_proposals
from feedsim.jobs.tune_feedforward import tune_feedforward as tune_feedforward
from feedsim.scenario import Machine as Machine
from feedsim.scenario import Scenario as Scenario
from feedsim.scenario import load_machine as load_machine
from feedsim.scenario.load import load_scenario as load_scenario
from feedsim.simulation.judge import JudgedRun as Run

__version__: str
