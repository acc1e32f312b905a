"""``omote render``, ``fit`` and ``export``: draw a head, make a head from a mesh, write a head for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from controller.base.errors import ConfigError
from controller.cli.completion import expressions, identities, names_of
from controller.cli.completion import settings as setting_names
from controller.cli.console import console, show_table
from controller.cli.film import FilmRate, FilmTake, Sound, check_film, render_film
from surface.base.extras import require

if TYPE_CHECKING:
    from controller.base.parameters import Parameters  # imported lazily: not needed for --help
    from controller.tools.surface_fit import SurfaceFit  # imported lazily: not needed for --help
    from controller.tools.transfer import Source  # imported lazily: not needed for --help
    from surface.export.animation import Animation  # imported lazily: not needed for --help
    from surface.fit.points.report import FitReport  # imported lazily: not needed for --help
    from surface.fit.source.load import LoadOptions  # imported lazily: not needed for --help
    from surface.head import Head  # imported lazily: not needed for --help

_NO_SHADE = "no OpenGL here: the head has no baked shading; for a better picture, fit it on a machine with OpenGL"
_FEW_SHAPES = (
    "the mesh has few shapes of a face, or none: with --expressions-from ict, the head gets those that it lacks, and "
    "keeps its own"
)
Identity = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=AMOUNT,...",
        help="Variations of the head's shape to mix in, each 0 to 1.",
        autocompletion=identities,
    ),
]
Vocabularies = Annotated[
    list[str] | None,
    typer.Option("--vocabulary", metavar="FILE", help="File with your own expressions or parameters; may be repeated."),
]
Person = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[=WEIGHT,...]",
        help="Person (skin, eyes, hair, identity) to show: a name from configs/persons or a file; or a mixture.",
        autocompletion=names_of("persons"),
    ),
]
Expression = Annotated[
    list[str] | None,
    typer.Option(
        "--expression", "-e", metavar="NAME[=INTENSITY]", help="Add a named expression.", autocompletion=expressions
    ),
]
Setting = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a parameter; a name without Left or Right sets both sides. May be repeated.",
        autocompletion=setting_names,
    ),
]
MAX_CROWD = 1024
HEAD = "Head: a name from configs/heads or a folder."


def render(
    out: Annotated[Path, typer.Option("--out", "-o", help="Picture to write (PNG), or film (.mp4, .webp, .gif).")],
    settings: Setting = None,
    expression: Expression = None,
    size: Annotated[str | None, typer.Option(help="Width x height in pixels.", show_default="800x800")] = None,
    camera: Annotated[
        str | None,
        typer.Option(help="front, three-quarter, three-quarter-right, profile or profile-right.", show_default="front"),
    ] = None,
    quality: Annotated[str | None, typer.Option(help="full or fast; auto means full.", show_default="full")] = None,
    theme: Annotated[str | None, typer.Option(help="skin, mask or robot.", show_default="skin")] = None,
    background: Annotated[
        str | None, typer.Option(metavar="#RRGGBB[,#RRGGBB]", help="One colour, or a gradient from top to bottom.")
    ] = None,
    evaluator: Annotated[
        str | None, typer.Option(help="Where vertices are computed: auto, cpu or gpu.", show_default="auto")
    ] = None,
    head: Annotated[str | None, typer.Option(help=HEAD, show_default="ict", autocompletion=names_of("heads"))] = None,
    identity: Identity = None,
    person: Person = None,
    stage: Annotated[
        str | None,
        typer.Option(
            help="Stage file that sets head or heads, groups, expressions, picture and idle motion of films, unless "
            "other options do.",
            autocompletion=names_of("stages"),
        ),
    ] = None,
    vocabulary: Vocabularies = None,
    group: Annotated[
        list[str] | None,
        typer.Option(metavar="FILE[=AMOUNT]", help="Group of control points to move, amount -1 to 1; may be repeated."),
    ] = None,
    sheet: Annotated[
        bool, typer.Option("--sheet", help="Draw every parameter at its limit and every named expression.")
    ] = False,
    crowd: Annotated[
        int | None,
        typer.Option(
            metavar="HEADS", min=1, max=MAX_CROWD, help="Draw this number of heads, each with another expression."
        ),
    ] = None,
    take: FilmTake = None,
    sound: Sound = None,
    rate_hz: FilmRate = None,
) -> None:
    """Draw one picture of the face, or a film of a take or show, without a display.

    Example: omote render --set jawOpen=0.8 --size 800x800 -o out.png; a film:
    omote render --take configs/scripts/tour.toml --sound hello.wav -o tour.mp4
    """
    check_film(take, sound, rate_hz, {"--sheet": sheet, "--crowd": crowd})
    require("a picture", "moderngl", "PIL")
    # imported lazily: not needed for --help
    from controller.face.still import Still, draw_crowd, draw_sheet, draw_still, reject_for_wall
    from controller.stage.persons import parse_person
    from controller.stage.picture import parse_background

    look = {
        "camera": camera, "quality": quality, "theme": theme, "background": parse_background(background),
        "evaluator": evaluator, "person": parse_person(person),
    }  # fmt: skip
    still = Still.parse(
        settings or [], expression or [], size, look, head, identity,
        stage=stage, vocabularies=vocabulary or (), groups=group or (),
    )  # fmt: skip
    if sheet and crowd:
        raise ConfigError("--sheet and --crowd draw different pictures", hint="leave out one of them")
    if still.wall is not None:
        reject_for_wall(still.wall, {"--sheet": sheet, "--crowd": crowd})
    if take is not None:
        render_film(still, out, take, sound, rate_hz)
        return
    if sheet or crowd:
        draw = partial(draw_crowd, still, crowd) if crowd else partial(draw_sheet, still)
        with console.status("drawing") as status:
            draw(out, lambda done, total: status.update(f"drawing {done} of {total}"))
    else:
        draw_still(still, out)
    console.print(f"wrote {out}", soft_wrap=True)


def fit(
    mesh: Annotated[
        Path,
        typer.Argument(
            help="Mesh with UVs and shapes: .glb, .gltf, .vrm, .obj, a folder of .obj files, or .npz. "
            "With --expressions-from, also a mesh without them, also .ply, .stl and .off. "
            "Or spline surfaces, which are kept exactly: .3dm, .tsm, .xml (G+Smo), .json."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the head to write.")],
    name: Annotated[str | None, typer.Option(help="Name of the head. Default: the folder's name.")] = None,
    shapes: Annotated[Path | None, typer.Option(help="Folder with one .obj per shape, for an .obj mesh.")] = None,
    names: Annotated[
        Path | None, typer.Option(help="TOML file with a table [names]: shape name of the mesh = ARKit's name.")
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(help="mm, cm, dm, m, in or ft. Default: the format's unit, else estimated from the eyes."),
    ] = None,
    up: Annotated[str | None, typer.Option(help="Axis that points up: x, y, z, -x, -y or -z.")] = None,
    forward: Annotated[str | None, typer.Option(help="Axis that the face looks along.")] = None,
    without: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Leave out an object or material; may be repeated.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Take only this surface of a file; may be repeated.")
    ] = None,
    groups: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Groups of a surface's control points (.toml, .json); may be repeated."),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a surface file if any part of it cannot be read.")
    ] = False,
    identities: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Identity modes of the mesh (.npz) to add as named variations.")
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep the existing head: only measure it again, and add --identities.")
    ] = False,
    expressions_from: Annotated[
        str | None,
        typer.Option(
            "--expressions-from",
            metavar="HEAD",
            help="Head, as ict, whose expressions a mesh gets in place of those it has no shapes for; also surfaces.",
            autocompletion=names_of("heads"),
        ),
    ] = None,
    no_own_shapes: Annotated[
        bool,
        typer.Option(
            "--no-own-shapes", help="With --expressions-from: take none of the mesh's own shapes, but all there."
        ),
    ] = False,
    landmarks: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Landmarks picked on the mesh (.toml, .json, .pp), for --expressions-from."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for a report: numbers, tables, error drawn on the face.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write the head even if it differs too much from its mesh.")
    ] = False,
) -> None:
    """Turn a mesh with UVs and expression shapes, or a file of surfaces, into a head of control points.

    Example: omote fit me.glb -o heads/me --report report; without shapes:
    omote fit scan.ply -o heads/scan --expressions-from ict; surfaces:
    omote fit face.3dm -o heads/face --groups groups.toml
    """
    # imported lazily: not needed for --help
    from controller.tools.surface_fit import SurfaceFit, is_surface_file, reject_surface_options
    from controller.tools.transfer import Source, check_transfer
    from surface.fit.identities import add_identities
    from surface.fit.source.load import LoadOptions

    if is_surface_file(mesh):
        meshes_only = {"--shapes": shapes, "--names": names, "--identities": identities, "--keep": keep}
        meshes_only |= {"--force": force, "--no-own-shapes": no_own_shapes}
        job = SurfaceFit(
            mesh, out, name, unit, up, forward, tuple(without or ()), tuple(only or ()), tuple(groups or ()),
            strict, expressions_from, landmarks, report,
        )  # fmt: skip
        job.check(meshes_only)
        _fit_surfaces(job)
        return
    reject_surface_options(mesh, {"--only": only, "--groups": groups, "--strict": strict})

    given = {"--identities": identities, "--keep": keep}
    check_transfer(expressions_from, landmarks, given, own_shapes=not no_own_shapes)
    options = LoadOptions(shapes, names, unit, up, forward, tuple(without or ()))
    if keep:
        _reject_with_keep(mesh, out, {"--name": name, "--report": report, "--force": force})
        _measure_head(mesh, out, options)
    else:
        source = Source(expressions_from, landmarks, not no_own_shapes) if expressions_from is not None else None
        _fit_mesh(mesh, out, name or out.resolve().name, options, source, report, force)
    if identities is not None:
        with console.status("fitting identities"):
            added = add_identities(out, mesh, identities)
        console.print(f"identities: {', '.join(added)}", soft_wrap=True)


def _reject_with_keep(mesh: Path, out: Path, given: Mapping[str, object]) -> None:
    """Raise ConfigError for an option that only applies when a head is written."""
    instead = {
        "--name": f"change name in {out / 'head.toml'}",
        "--report": f"a report needs a new fit: omote fit {mesh} -o OTHER_FOLDER --report {given['--report']}",
        "--force": "leave it out, or leave out --keep to write the head again",
    }
    for option, value in given.items():
        if value:
            raise ConfigError(f"{option}: cannot be used with --keep, which writes no head", hint=instead[option])


def _fit_mesh(
    mesh: Path, out: Path, title: str, options: LoadOptions, source: Source | None, report: Path | None, force: bool
) -> None:
    """Write a head made from a mesh, with its own shapes or the expressions of another head, and print the errors."""
    from controller.tools.transfer import transfer  # imported lazily: not needed for --help
    from surface.fit.api import fit_head

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)

        def progress(part: str, done: float) -> None:
            step = "writing the report" if part == "report" else f"fitting {part}"
            bar.update(task, description=step, completed=done)

        if source is not None:
            found = transfer(mesh, source, out, title, options, progress, report, force)
        else:
            found = fit_head(mesh, out, name=title, progress=progress, options=options, report_dir=report, force=force)
    shaded = _decimate_and_shade(out)
    show_table(_error_table(found))
    for line in _fit_remarks(found, shaded) + _check_lines(out):
        console.print(line, soft_wrap=True, markup=False)
    console.print(f"wrote {out}", soft_wrap=True)


def _measure_head(mesh: Path, out: Path, options: LoadOptions) -> None:
    """Measure and print the distances between a head at rest and the mesh that it was fitted to."""
    import numpy as np  # imported lazily: not needed for --help

    from surface.fit.api import measure_head

    with console.status("measuring"):
        found = measure_head(out, mesh, options)
    table = Table("part", "vertices", "RMS", "99 %", "max", title=f"distance at rest from {mesh.name}, mm")
    for name, distances in found.items():
        mm = distances[np.isfinite(distances)]
        figures = np.sqrt(np.mean(mm**2)), np.percentile(mm, 99.0), mm.max()
        table.add_row(name, str(len(mm)), *(f"{each:.3f}" for each in figures))
    show_table(table)


def _fit_surfaces(job: SurfaceFit) -> None:
    """Write a head made from a surface file, and print its parts."""
    with console.status("reading") as status:
        found = job.run(lambda step, done: status.update(f"{step}: {100 * done:.0f} %"))
    shaded = _decimate_and_shade(job.out)
    title = f"{found.name}: {found.points} control points, {len(found.parameters)} shapes"
    table = Table("part", "in the file", "material", "follows", "control points", title=title)
    for row in found.parts:
        table.add_row(row.name, row.title, row.material, row.follows, str(row.points))
    show_table(table)
    for line in [*found.lines(), *([] if shaded else [_NO_SHADE])]:
        console.print(line, soft_wrap=True, markup=False)
    console.print(f"wrote {job.out}", soft_wrap=True)


def _fit_remarks(found: FitReport, shaded: bool) -> list[str]:
    """Return the lines below the table of a fit: bounds, pieces, notes, missing shapes, greatest errors, faults."""
    from surface.fit.points.report import face_bounds, kinds_line  # imported lazily: not needed for --help

    missing, left_out = ", ".join(found.missing), ", ".join(found.left_out)
    lines = [face_bounds(found), *filter(None, [kinds_line(found)]), *found.notes]
    lines += [f"no shape for {missing}: these parameters will not move this head"] if missing else []
    lines += [f"left out, not ARKit's: {left_out}"] if left_out else []
    lines += [_FEW_SHAPES] if len(found.missing) > len(found.parameters) or not found.parameters else []
    lines += [] if shaded else [_NO_SHADE]
    lines += found.dense.lines()[::-1] if found.dense else []
    return lines + [f"written by --force: {fault}" for fault in found.faults]


def _check_lines(out: Path) -> list[str]:
    """Return what ``omote check`` reports of a head, without overlaps of skin, which the remarks of a fit contain."""
    # imported lazily: not needed for --help
    from surface.check import check_head
    from surface.head import Head

    with console.status("checking"):
        return [f"check: {f.line(str(out))}" for f in check_head(Head.load(out)) if f.kind != "overlap"]


def _decimate_and_shade(out: Path) -> bool:
    """Add decimated triangles and baked shading to a head's folder; return False if there is no OpenGL for shading."""
    # imported lazily: not needed for --help
    from surface.base.errors import MissingPackage, ViewError
    from surface.view.draw.decimate import decimate_head
    from surface.view.draw.grain import grain_head
    from surface.view.pictures.occlusion import shade_head
    from surface.view.pictures.outside import find_outside

    with console.status("decimating triangles for live pictures"):
        decimate_head(out)
        grain_head(out)
    try:
        with console.status("baking the shading"):
            shade_head(out)
        with console.status("finding what can be seen of hair and accessories"):
            find_outside(out)
    except (ViewError, MissingPackage):
        return False
    return True


def _error_table(report: FitReport) -> Table:
    """Return a table of the control points and errors (mm) of every fitted part."""
    title = f"{report.name}: {report.points} control points, {len(report.parameters)} shapes"
    table = Table("part", "control points", "RMS", "99 %", "max", "mean RMS of shapes", title=title)
    for part in report.parts:
        shapes = f"{part.mean_shape_rms:.3f}" if part.neutral.measured else "-"
        table.add_row(part.name, str(part.points), *part.neutral.figures(), shapes)
    return table


def export(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write: .glb, .obj, .urdf or a format of a plug-in.")
    ],
    head: Annotated[str, typer.Option("--head", help=HEAD, autocompletion=names_of("heads"))] = "ict",
    settings: Setting = None,
    expression: Expression = None,
    vocabulary: Vocabularies = None,
    identity: Identity = None,
    person: Person = None,
    frame: Annotated[
        str, typer.Option(help="Axes and origin. head: y up, z forward; file: those of the mesh it was fitted to.")
    ] = "head",
    take: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Take, recording or show to write as animation of the .glb.")
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate", min=1, max=1000, help="Frames per second of --take.", show_default="the take's own, or 60"
        ),
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Write a small .glb for web pages, with fewer triangles.")] = False,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Robot file whose servo limits become joint limits of the .urdf.", autocompletion=names_of("robots")
        ),
    ] = None,
) -> None:
    """Write a head for other programs: .glb with morph targets, .obj with a folder of shapes, .urdf for robots.

    Example: omote export head.glb; with an animation: omote export head.glb --take alex_rom_3.csv
    """
    # imported lazily: not needed for --help
    from controller.face.still import Still
    from controller.stage.persons import parse_person
    from controller.tools.plugins import EXPORTERS, added_exporters
    from surface.export import export_head

    look = {"person": parse_person(person)}
    still = Still.parse(
        settings or [], expression or [], look=look, head=head, identity=identity, vocabularies=vocabulary or ()
    )
    with console.status("exporting"):
        loaded = still.load_head()
        values = zip(still.parameters.names, still.values, strict=True)
        pose = {name: float(value) for name, value in values if value and name in loaded.parameters}
        added = added_exporters()
        kind = next((each.kind for each in added if out.suffix.lower() in each.suffixes), "")
        with EXPORTERS.naming_package(kind):
            if robot is None:
                written = export_head(
                    loaded, out, pose, added, frame, _animation(take, rate_hz, loaded, still.parameters), web
                )
            else:
                written = _write_urdf_with_limits(robot, loaded, out, pose)
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)


def _write_urdf_with_limits(robot: str, head: Head, out: Path, pose: dict[str, float]) -> list[Path]:
    """Write a .urdf with the limits of a robot's servos. Raises ConfigError: another suffix, or no such robot."""
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.base.paths import find_config
    from controller.robot.joint_limits import joint_limits
    from controller.robot.robot import load_robot, robot_parameters
    from surface.export.urdf import write_urdf
    from surface.head.model.joints import joints_of

    if out.suffix.lower() != ".urdf":
        hint = "omote export head.urdf --robot head24"
        raise ConfigError("--robot: its servos limit the joints of a .urdf", hint=hint)
    path = find_config("robots", robot)
    found = load_robot(path, PARAMETERS)
    parameters = robot_parameters(found, path, PARAMETERS)
    return write_urdf(head, out, pose, joint_limits(found, parameters, joints_of(head.data)))


def _animation(take: Path | None, rate_hz: float | None, head: Head, parameters: Parameters) -> Animation | None:
    """Return a take as an animation of ``head``, or None. Raises ConfigError: ``rate_hz`` without a take."""
    import numpy as np  # imported lazily: not needed for --help

    # imported lazily: as above
    from controller.face.face import head_indices
    from controller.tools.motion_file import load_motion
    from surface.export.animation import Animation
    from surface.head.model.parameters import NAMES

    if take is None and rate_hz is not None:
        raise ConfigError("--rate: there is no --take", hint="--take alex_rom_3.csv --rate 30")
    if take is None:
        return None
    motion = load_motion(take, parameters, rate_hz)
    values = motion.with_rest()[:, head_indices(parameters, head.parameters)]
    amounts = np.array([head.own_amounts(row) for row in values]) if head.own_groups else np.zeros((len(values), 0))
    own = {group.name: amounts[:, i] for i, group in enumerate(head.own_groups)}
    return Animation(take.stem, motion.times_s, values[:, : len(NAMES)], own)
