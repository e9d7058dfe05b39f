"""More awkward logs: text notations, starts of runs, too few rows, impossible values."""

from cases import CASES, case, error, suspect
from joint import RATE_HZ, ROWS, RUNS, joint, on_one_clock, rows, table

# ---- text

PLAIN = table(joint())
case("UTF-16 from a spreadsheet", {"log.txt": ("\ufeff" + table(joint(), by="\t", end="\r\n")).encode("utf-16-le")})
case("UTF-16, the other order, no mark", {"log.csv": PLAIN.encode("utf-16-be")})
case(
    "semicolons, decimal commas and a byte order mark",
    ("\ufeff" + table(joint(), by=";").replace(".", ",")).encode(),
    expected_lines=["commas inside numbers are decimal points"],
)
case(
    "remarks above and between",
    "# logger 7\n# kp: 3, kd: 4\n\n" + PLAIN.replace("\n1,0.0,", "\n# the second run\n1,0.0,"),
    data={"rows": RUNS * ROWS, "rows_left_out": 0},
)
case("a header that is a remark", "# made by numpy\n# " + PLAIN)
case("remarks as MATLAB writes them", "% joint 3\n%% 2024\n" + PLAIN)
case("blank lines and quotes", "\n\n" + PLAIN.replace("time_s", '"time_s"').replace("\n2,", "\n\n2,"))


def lists(form):
    return table(joint(
        velocity=("velocity", lambda r: form(0.25, r["v"], -1.0)), torque=("effort", lambda r: form(9.0, r["tau"], 9.0)),
    ))


case(
    "arrays in brackets",
    lists(lambda *values: "[" + " ".join(map(repr, values)) + "]"),
    "--columns velocity_rad_s=velocity[1],torque_nm=effort[1]",
)
case(
    "arrays of Python, with a unit",
    lists(lambda *values: '"array(\'d\', [' + ", ".join(repr(1e3 * value) for value in values) + '])"'),
    "--columns velocity_rad_s=velocity[1]:mrad/s,torque_nm=effort[1]:mNm",
)
case(
    "columns whose names have brackets",
    table(joint(velocity=("velocity[1]", lambda r: r["v"]), torque=("effort[1]", lambda r: r["tau"]))),
    "--columns velocity_rad_s=velocity[1],torque_nm=effort[1]",
)
error(
    "arrays of which none is chosen",
    lists(lambda *values: "[" + " ".join("1" for _ in values) + "]"),
    'log.csv: row 2, column velocity: found "[1 1 1]", expected a number; of a list, --columns NAME=COLUMN[0] takes the '
    "first (1200 of 1200 rows are bad, this is the first; at most 5 % may be)",
    "--columns velocity_rad_s=velocity,torque_nm=effort",
)
error("an empty file", "", "log.csv: found an empty file, expected a header and a row per sample")
error("a header alone", "time_s,velocity_rad_s,torque_nm\n", "log.csv: found a header and no rows, expected a row per sample")
error(
    "no header",
    "0,1,2\n1,2,3\n",
    "log.csv: found numbers in the first row and no header, expected the columns' names (time_s, velocity_rad_s, torque_nm "
    "..), or --columns 1=time_s,2=velocity_rad_s,3=torque_nm with the number of each column; --columns help shows them",
)
PYTHON = "expected a CSV or Parquet file: python -c "
for kind, head, line in [
    (
        "a spreadsheet",
        b"PK\x03\x04\0\0[Content_Types].xml",
        "found a spreadsheet, expected a CSV file: libreoffice --headless --convert-to csv log.csv",
    ),
    (
        "an old spreadsheet",
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "found a spreadsheet, expected a CSV file: libreoffice --headless --convert-to csv log.csv",
    ),
    ("an xz archive", b"\xfd7zXZ\0", "found an xz archive, expected a CSV or Parquet file: unxz -k log.csv"),
    (
        "a MAT file",
        b"MATLAB 5.0 MAT-file, Platform: GLNXA64",
        "found a MAT file, expected a CSV or Parquet file: writetable(struct2table(load('log.csv')), 'log.csv') in MATLAB",
    ),
    (
        "an HDF5 file",
        b"\x89HDF\r\n\x1a\n",
        f"found an HDF5 file (or a MAT file of version 7.3), {PYTHON}\"import pandas; "
        "pandas.read_hdf('log.csv').to_parquet('log.parquet')\", or writetable in MATLAB",
    ),
    (
        "a NumPy array",
        b"\x93NUMPY\x01\0",
        f"found a NumPy array, {PYTHON}\"import numpy, pandas; "
        "pandas.DataFrame(numpy.load('log.csv')).to_csv('log.csv')\", with the columns' names",
    ),
    (
        "a NumPy archive",
        b"PK\x03\x04\0\0tau.npy",
        f"found a NumPy archive, {PYTHON}\"import numpy, pandas; "
        "pandas.DataFrame(dict(numpy.load('log.csv'))).to_csv('log.csv')\"",
    ),
    (
        "a ROS 2 bag of SQLite",
        b"SQLite format 3\0",
        "found an SQLite database (a ROS 2 bag, if it ends in .db3), expected an MCAP, CSV or Parquet file: ros2 bag convert "
        "-i log.csv -o mcap.yaml, or sqlite3 -csv -header log.csv 'select * from TABLE' > log.csv",
    ),
    (
        "a ROS 1 bag",
        b"#ROSBAG V2.0\n",
        "found a ROS 1 bag, expected an MCAP, CSV or Parquet file: mcap convert log.csv log.mcap, or rostopic echo -b log.csv "
        "-p /TOPIC > log.csv",
    ),
    (
        "an MDF file",
        b"MDF     4.10",
        f"found an MDF file, {PYTHON}\"from asammdf import MDF; MDF('log.csv').export('parquet', 'log.parquet')\"",
    ),
    (
        "a TDMS file",
        b"TDSm\x0e\0\0\0",
        f"found a TDMS file, {PYTHON}\"import nptdms; "
        "nptdms.TdmsFile('log.csv').as_dataframe().to_csv('log.csv')\"",
    ),
]:
    error(kind, head, f"log.csv: {line}")
error(
    "two targets",
    table(joint(force=("force_n", lambda r: r["tau"]))),
    "log.csv: row 1, column force_n: found torque_nm as well, expected one target: torque_nm for a rotary joint or "
    "force_n for a linear joint",
)
error(
    "one name twice",
    "time_s,velocity_rad_s,torque_nm,torque_nm\n0,1,2,2\n",
    "log.csv: row 1, column torque_nm: found the name twice (columns 3 and 4), expected each name once",
)
error(
    "words for a fifth of the velocities",
    table(joint(velocity=("velocity_rad_s", lambda r: "off" if r["i"] % 5 == 3 else r["v"]))),
    'log.csv: row 5, column velocity_rad_s: found "off", expected a finite number (240 of 1200 rows are bad, this is the '
    "first; at most 5 % may be; --bad-rows 20% leaves them out)",
)
case(
    "a few words, ragged rows and a row that goes back",
    PLAIN.replace("\n0,0.5,", "\n0,half,").replace("\n1,0.7,", "\n1,0.7,7,") + "2,1.0,0.0,0.0\n",
    expected_lines=[
        "3 rows are left out as bad:",
        '  log.csv: row 52, column time_s: found "half", expected a finite number',
        "  log.csv: row 472, column (all): found 5 cells, expected 4 cells as in the header",
        "  log.csv: row 1202, column time_s: found 1, expected a time not before 3.99 of row 1201",
    ],
    data={"rows_left_out": 3},
)

# ---- runs

case(
    "starts without a run column",
    table(joint(run=None, time=("time_s", on_one_clock))),
    expected_lines=["there is no column run: the file is split into 3 runs, at pauses of more than 1 s and where the clock restarts"],
    data={"runs": RUNS, "rows": RUNS * ROWS},
)
case(
    "a clock that begins anew",
    table(joint(run=None)),
    expected_lines=["the file is split into 3 runs"],
    data={"runs": RUNS, "rows_left_out": 0},
)
case(
    "gaps that are no starts",
    table(joint(), of=[row for row in rows() if row["i"] % 100 > 8]),
    expected_lines=["time-jump: The log has 9 gaps, the longest of 0.1000 s: each segment between them is used separately."],
    data={"runs": RUNS},
)
error(
    "a clock that runs backwards",
    table(joint(run=None, time=("time_s", lambda r: 9 - on_one_clock(r)))),
    "log.csv: row 3, column time_s: found 8.99, expected a time not before 9 of row 2 (1199 of 1200 rows are bad, this is "
    "the first; at most 5 % may be)",
)
case(
    "no velocity, but a position",
    table(joint(velocity=("position_rad", lambda r: r["q"]))),
    expected_lines=["no velocity is logged: it is the difference of the positions"],
    ranges={"position_rad": [-1, 1]},
)
case(
    "no velocity, and a position in degrees",
    table(joint(velocity=("angle", lambda r: 57.29577951308232 * r["q"]))),
    "--columns position_rad=angle:deg",
    ranges={"position_rad": [-1, 1]},
)
case("the first samples dropped", PLAIN, "--skip 50", data={"rows": RUNS * (ROWS - 50)})
case("every tenth sample judged", PLAIN, "--decimate 10", data={"rows": RUNS * ROWS})
case(
    "a held-out file by hand",
    {"log.csv": PLAIN, "other.csv": table(joint(), of=rows(200, 2))},
    "--test other.csv",
    data={"test_runs": ["other:0", "other:1"], "train_runs": ["log:0", "log:1", "log:2"]},
)

# ---- too little, and what cannot be

suspect(
    "thirty rows",
    table(joint(), of=rows(30, 1)),
    "too-little: 30 rows are too few: laws that differ by one parameter cannot be distinguished with them.",
)
case(
    "a reading of 9999",
    table(joint(torque=("torque_nm", lambda r: 9999.0 if (r["run"], r["i"]) == (1, 250) else r["tau"]))),
    expected_lines=["outlier: 1 value of torque_nm cannot be (the farthest is 9999, in run 1 at 2.500 s, alone between neighbours of "
          "another size): the row is left out."],
    data={"rows_left_out": 1},
)
suspect(
    "one steady speed",
    table(joint(velocity=("velocity_rad_s", lambda r: 1.0), torque=("torque_nm", lambda r: 0.7 + 1e-3 * (r["i"] % 7)))),
    "too-little: 1200 rows hold 3 changes of speed or direction",
)

__all__ = ["CASES"]
