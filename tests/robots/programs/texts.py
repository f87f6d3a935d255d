"""Programs as people write them, with blanks, comments and line ends of all kinds, for hypothesis."""

from hypothesis import strategies as st

NUMBERS = st.one_of(
    st.floats(-2000, 2000).map(lambda value: f"{value:.3f}"),
    st.integers(-999, 999).map(str),
    st.sampled_from(["1.", ".5", "-0", "0.70710678", "3.09086E-08", "+2"]),
)
QUATERNIONS = st.sampled_from(
    ["-.99499,0.1,0,1E-3", "+0.5,.5,0.5,-0.5", "0.70710678,0,0, 7.071068E-1", "0,1.,0,-0"]
)
BLANKS = st.sampled_from(["", " ", "\t", "  "])
EXTERNAL = "[9E9,9E+09, 0,9E9,9E9,9E9]"
LINE_ENDS = st.sampled_from(["\n", "\r\n", "\r"])


@st.composite
def rapid_modules(draw) -> str:
    """A module with targets, moves and everything that may stand between them."""
    end, blank = draw(LINE_ENDS), draw(BLANKS)

    def row(count: int) -> str:
        return "[" + f",{blank}".join(draw(NUMBERS) for _ in range(count)) + blank + "]"

    lines = ["%%%", "MODULE m", f"  CONST num a{blank}:={blank}5; ! a := [[1,2,3],[1,0,0,0]]"]
    for number in range(draw(st.integers(1, 4))):
        rotation = f"[1,{blank}0, 0 ,0]" if draw(st.booleans()) else f"[{draw(QUATERNIONS)}]"
        configuration = f"[{','.join(str(draw(st.integers(-4, 4))) for _ in range(4))}]"
        value = f"[{row(3)},{rotation},{blank}{configuration},{EXTERNAL}]"
        lines.append(f"LOCAL {draw(st.sampled_from(['CONST', 'PERS', 'var']))} robtarget p{number}:={value};")
        lines.append(f'  TPWrite "p{number} \xe9; ! no comment ""quoted""";')
    lines.append(f"  PROC main(){end}    ! MoveL p0, v100, fine, gone;")
    lines += [f"IF a=1 THEN MOVEL p{number},v100\\V:=5,z10 ,tool0; ENDIF" for number in range(4)]
    lines.append(f"    MoveAbsJ [{row(6)},{EXTERNAL}]\\NoEOffs, v100, fine, tool0\\WObj:=wobj0;")
    return end.join([*lines, "  ENDPROC", "ENDMODULE"]) + draw(st.sampled_from(["", end]))


@st.composite
def krl_lists(draw) -> str:
    """A data list with poses, axes, frames and inline motions."""
    end, blank = draw(LINE_ENDS), draw(BLANKS)
    keys = ["X", "Y", "Z", "A", "B", "C"]
    lines = [
        "&ACCESS RV",
        "&REL 1",
        "DEFDAT m PUBLIC",
        ";FOLD {X 1,Y 2}",
        "EXT BAS (BAS_COMMAND :IN,REAL :IN )",
    ]
    for number in range(draw(st.integers(1, 4))):
        values = f",{blank}".join(f"{key} {draw(NUMBERS)}" for key in keys)
        turns = f",S {draw(st.integers(0, 7))},T {draw(st.integers(0, 63))}" if draw(st.booleans()) else ""
        lines.append(f"DECL E6POS XP{number}={{{values}{turns},E1 0.0,E2 0.0}} ; {{X 1}} \xfc")
        lines.append(f'DECL FDAT FP{number}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ;{{"}}')
    axes = ",".join(f"A{number} {draw(NUMBERS)}" for number in range(1, 7))
    lines += [
        f"DECL E6AXIS XHOME{blank}={{{blank}{axes}}}",
        "DECL FDAT FHOME={TOOL_NO 0,BASE_NO 0}",
        "ENDDAT",
    ]
    return end.join(lines) + draw(st.sampled_from(["", end]))


@st.composite
def tables(draw) -> str:
    """A table of poses with comments, quotes and foreign columns."""
    end, separator = draw(LINE_ENDS), draw(st.sampled_from([",", ";", "\t"]))
    has_commas = separator == ";" and draw(st.booleans())
    lines = [
        "# measured; on a Monday, 1,5",
        separator.join(["name", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]),
    ]
    for number in range(draw(st.integers(1, 5))):
        fields = [f'"p{number}{separator}"', *(draw(NUMBERS) for _ in range(3)), "0.8", "0.0", " 0 ", "-0.6"]
        line = separator.join(fields)
        lines.append(line.replace(".", ",") if has_commas else line)
    return end.join(lines) + draw(st.sampled_from(["", end]))
