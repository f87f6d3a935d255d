"""One look for the plotly figures of all pages, on white, on black and on paper."""

import plotly.graph_objects as go

# Told apart by people who do not see all colours: Okabe and Ito (2008), with the blue of the pages first.
COLORS = ("#0f7cc0", "#d55e00", "#009e73", "#c2739f", "#8a6d00", "#5b6675", "#7a5195", "#56b4e9")
INK = "#6a7585"  # of words and numbers; the script of the page sets that of its colour scheme
_GRID, _LINE = "rgba(128,140,156,0.25)", "rgba(128,140,156,0.6)"
_GRID_3D = "#a3adba"  # hairlines, of which translucent ones are not seen

_AXIS = {
    "gridcolor": _GRID,
    "zerolinecolor": _LINE,
    "linecolor": _LINE,
    "automargin": True,
    # 1e-10 as 10 to a power and not as "100p".
    "exponentformat": "power",
    "title": {"standoff": 8},
    # So that the first numbers of two axes do not touch in their corner.
    "ticklabelstandoff": 4,
}
_AXIS_3D = {
    "gridcolor": _GRID_3D,
    "zerolinecolor": _LINE,
    "linecolor": _LINE,
    "showbackground": False,
    "showspikes": False,
    "nticks": 6,
}

TEMPLATE = go.layout.Template(
    layout={
        "colorway": COLORS,
        "colorscale": {"sequential": "Viridis"},
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "xaxis": _AXIS,
        "yaxis": _AXIS,
        "scene": {
            **{f"{name}axis": _AXIS_3D for name in "xyz"},
            # The default view cuts off the titles of the axes.
            "camera": {"eye": {"x": 1.45, "y": 1.45, "z": 0.95}, "center": {"x": 0.0, "y": 0.0, "z": -0.1}},
        },
        # At the bottom of the whole figure, where it takes no width from it and leaves room for words above.
        "legend": {
            "orientation": "h",
            "x": 0.0,
            "y": 0.0,
            "yref": "container",
            "yanchor": "bottom",
            "itemsizing": "constant",
        },
        "margin": {"l": 60, "r": 20, "t": 28, "b": 50},
    }
)
_OF_SCENES = {"legend": {"yref": "paper"}, "margin": {"l": 0, "r": 0, "t": 0, "b": 0}}


def styled(figure: go.Figure, height: int) -> go.Figure:
    """The same figure in the look of the pages, so many px high."""
    figure.update_layout(height=height, template=TEMPLATE)
    if any(name.startswith("scene") for name in figure.layout.to_plotly_json()):
        figure.update_layout(_OF_SCENES)
    # Between decades plotly writes the first digit alone, "2" for 0.2.
    figure.for_each_xaxis(_whole_numbers)
    figure.for_each_yaxis(_whole_numbers)
    return figure


def _whole_numbers(axis: go.layout.XAxis | go.layout.YAxis) -> None:
    if axis.type == "log" and axis.tickformat is None:
        axis.tickformat = "~g"
