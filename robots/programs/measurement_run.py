"""Programs that drive a robot through measurement configurations: move, settle, trigger.

Probst (2024), section 6.4.2: at each configuration the vibrations are given 0.5 s to die out before the pose
and the joint positions are taken. The joints are read where the robot stands, because encoders do not stop
exactly where they were sent.
"""

from dataclasses import dataclass

import numpy as np

EXTERNAL = "[9E9,9E9,9E9,9E9,9E9,9E9]"
_PULSE = 0.1  # s, of the trigger
_EXPOSURE = 0.3  # s, for which the robot stands still after it
_COORDINATES = ("x_mm", "y_mm", "z_mm", "alpha_deg", "beta_deg", "gamma_deg")


@dataclass(frozen=True)
class MeasurementRun:
    """What a program does at each configuration."""

    q: np.ndarray  # (n, 6) rad, in the order of the visits
    settle: float = 0.5  # s before the trigger
    trigger: str = ""  # digital output: a name in RAPID, a number in KRL; empty for the default
    name: str = "measure"  # of the module and of the files that it writes
    # via points on the way to each configuration in rad, (k, 6) each; empty: all ways are straight
    vias: tuple[np.ndarray, ...] = ()

    def __post_init__(self) -> None:
        """Checks the numbers. Raises ValueError."""
        if self.q.ndim != 2 or self.q.shape[1:] != (6,) or not np.isfinite(self.q).all():
            raise ValueError(f"a measurement run takes joint positions (n, 6), got {self.q.shape}")
        if self.vias and len(self.vias) != len(self.q):
            raise ValueError(f"{len(self.q)} configurations need as many ways, got {len(self.vias)}")
        if not 0.0 <= self.settle <= 60.0:
            raise ValueError(f"the settling time must be between 0 and 60 s, got {self.settle:g} s")

    @property
    def ways(self) -> list[np.ndarray]:
        """The via points to each configuration in rad, (k, 6) each."""
        return list(self.vias) or [np.zeros((0, 6))] * len(self.q)


def rapid_run(run: MeasurementRun) -> dict[str, str]:
    """A RAPID module by the name of its file; on the controller it writes a table of joint positions."""
    output = run.trigger or "doTrigger"
    if not output.isidentifier():
        raise ValueError(f"the trigger must be the name of a digital output in RAPID, got '{run.trigger}'")
    head = ";".join(f"q{joint}_deg" for joint in range(1, 7))
    lines = [
        f"MODULE {run.name}",
        f"    ! Measurement run, {len(run.q)} configurations: move, settle, pulse {output}, note the joints.",
        f"    ! The joint positions stand in HOME:{run.name}_joints.csv afterwards.",
        f"    CONST num settle := {run.settle:g}; ! s",
        "    VAR iodev table;",
        "    VAR jointtarget here;",
    ]
    for number, q in enumerate(np.rad2deg(run.q), 1):
        lines.append(f"    CONST jointtarget m{number} := [[{listed(q)}],{EXTERNAL}];")
    for number, way in enumerate(run.ways, 1):
        for k, q in enumerate(np.rad2deg(way), 1):
            lines.append(f"    CONST jointtarget v{number}_{k} := [[{listed(q)}],{EXTERNAL}];")
    lines += [
        f"    PROC {run.name}_run()",
        f'        Open "HOME:"\\File:="{run.name}_joints.csv", table\\Write;',
        f'        Write table, "{head}";',
    ]
    for number, way in enumerate(run.ways, 1):
        lines += [f"        MoveAbsJ v{number}_{k}, v200, z10, tool0;" for k in range(1, len(way) + 1)]
        lines += [f"        MoveAbsJ m{number}, v200, fine, tool0;", "        take;"]
    lines += [
        "        Close table;",
        "    ENDPROC",
        "    PROC take()",
        "        WaitTime\\InPos, settle;",
        f"        PulseDO\\PLength:={_PULSE:g}, {output};",
        "        here := CJointT();",
    ]
    for joint in range(1, 7):
        end = "" if joint == 6 else ' + ";"\\NoNewLine'
        lines.append(f"        Write table, NumToStr(here.robax.rax_{joint},5){end};")
    lines += [f"        WaitTime {_EXPOSURE:g};", "    ENDPROC", "ENDMODULE", ""]
    return {f"{run.name}.mod": "\n".join(lines)}


def krl_run(run: MeasurementRun) -> dict[str, str]:
    """A KRL source and its data list by the names of their files; the data list keeps the joint positions."""
    output = run.trigger or "1"
    if not output.isdigit():
        raise ValueError(f"the trigger must be the number of a digital output in KRL, got '{run.trigger}'")
    count, has_vias = len(run.q), any(len(way) for way in run.ways)
    source = [
        f"DEF {run.name}()",
        f"; Measurement run of {count} configurations: move, settle, pulse output {output}, note the joints.",
        f"; The joint positions stand in Q[] of {run.name}.dat afterwards.",
        "DECL INT i,k" if has_vias else "DECL INT i",
        "BAS(#INITMOV,0)",
        "BAS(#VEL_PTP,20)",
        f"FOR i=1 TO {count}",
        *(["  FOR k=F[i] TO F[i+1]-1", "    PTP V[k]", "  ENDFOR"] if has_vias else []),
        "  PTP M[i]",
        f"  WAIT SEC {run.settle:g}",
        f"  PULSE($OUT[{output}],TRUE,{_PULSE:g})",
        "  Q[i]=$AXIS_ACT",
        f"  WAIT SEC {_EXPOSURE:g}",
        "ENDFOR",
        "END",
        "",
    ]
    data = [f"DEFDAT {run.name}", f"DECL E6AXIS Q[{count}]", f"DECL E6AXIS M[{count}]"]
    vias = np.concatenate(run.ways)
    if has_vias:  # those to configuration i stand from F[i] on
        data += [f"DECL E6AXIS V[{len(vias)}]", f"DECL INT F[{count + 1}]"]
        first = 1 + np.cumsum([0, *(len(way) for way in run.ways)])
        data += [f"F[{number}]={k}" for number, k in enumerate(first, 1)]
    for name, rows in (("M", run.q), ("V", vias)):
        data += [f"{name}[{number}]={krl_axes(q)}" for number, q in enumerate(np.rad2deg(rows), 1)]
    return {f"{run.name}.src": "\n".join(source), f"{run.name}.dat": "\n".join([*data, "ENDDAT", ""])}


def table_to_fill(run: MeasurementRun, position_only: bool = False) -> str:
    """The table of the run, as `truetip calibrate` reads it: joints as commanded, poses still empty."""
    coordinates = _COORDINATES[:3] if position_only else _COORDINATES
    head = [*(f"q{joint}_deg" for joint in range(1, 7)), *coordinates]
    rows = [[*(spelled(value) for value in q), *[""] * len(coordinates)] for q in np.rad2deg(run.q)]
    comment = "# Put in what the controller noted of the joints, and where the instrument saw the tool."
    return "\n".join([comment, *(",".join(row) for row in [head, *rows])]) + "\n"


RUNS = {"rapid": rapid_run, "krl": krl_run}


def krl_axes(q: np.ndarray) -> str:
    """Joint positions in degrees as KRL writes them."""
    axes = ",".join(f"A{joint} {spelled(value)}" for joint, value in enumerate(q, 1))
    return f"{{{axes},E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}}"


def listed(values: np.ndarray) -> str:
    """Numbers as both languages write them, with commas between."""
    return ",".join(spelled(value) for value in values)


def spelled(value: float) -> str:
    """A number with at most five digits behind the point."""
    text = f"{value:.5f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
