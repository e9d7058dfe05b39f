//! Examples of every command, which begin its help.

use clap::Command;

/// Examples of a command: its path below `host-sim`, empty for the program, and two calls of it. A call may end with a
/// shell comment.
type Examples = (&'static str, [&'static str; 2]);

const EXAMPLES: &[Examples] = &[
    (
        "",
        [
            "host-sim demo                          # the whole story in a minute, without hardware",
            "host-sim diagnose my-log.csv           # what a model of my joint misses, and why",
        ],
    ),
    (
        "demo",
        ["host-sim demo", "host-sim demo --seed 7 --out out/demo-7     # the same joint each time"],
    ),
    (
        "simulate",
        [
            "host-sim simulate underwater-joint --out out/joint",
            "host-sim simulate low-speed --hide position-ripple --seed 3 --out out/ripple",
        ],
    ),
    (
        "diagnose",
        [
            "host-sim diagnose my-log.csv --columns help    # which columns the file has",
            "host-sim diagnose my-log.csv --columns torque_nm=tau_3:mNm,velocity_rad_s=dq_3:rpm",
        ],
    ),
    (
        "identify",
        [
            "host-sim identify my-log.csv --model lugre",
            "host-sim identify my-log.csv --model stribeck+pressure-coulomb --rigid-body inertia,gravity",
        ],
    ),
    (
        "compare",
        [
            "host-sim compare my-log.csv                    # all laws, on held-out runs",
            "host-sim compare monday.csv --test friday.csv --models linear,stribeck,lugre",
        ],
    ),
    (
        "predict",
        [
            "host-sim predict out/diagnose-my-log/params.toml new-log.csv",
            "host-sim predict params.toml new-log.csv --start rest --out rows.csv",
        ],
    ),
    (
        "export",
        [
            "host-sim export params.toml --to c             # a header for a loop of your own",
            "host-sim export params.toml --to mujoco --out out/simulator",
        ],
    ),
    (
        "fleet",
        [
            "host-sim fleet logs/ --out out/fleet           # logs/JOINT/CAMPAIGN.csv",
            "host-sim fleet logs/ --limit coulomb_torque=3.0",
        ],
    ),
    (
        "paper",
        [
            "host-sim paper underwater-joint --quick        # about one minute",
            "host-sim paper damper --data ../shared/data --out out/damper",
        ],
    ),
    (
        "node",
        [
            "host-sim node --bus vcan0                      # a joint driver on this PC",
            "host-sim node --bus vcan0 --motor              # with a simulated motor and joint",
        ],
    ),
    (
        "replay",
        [
            "host-sim replay out/trace.log --rate max       # in this process, without a bus",
            "host-sim replay out/trace.log --bus vcan0 --params params.toml",
        ],
    ),
    (
        "params",
        ["host-sim params --bus can0 status", "host-sim params --bus can0 set params.toml --save"],
    ),
    (
        "params get",
        [
            "host-sim params --bus can0 get > params.toml   # all of them, as a file",
            "host-sim params --bus can0 get static_torque motor.gear_ratio",
        ],
    ),
    (
        "params set",
        [
            "host-sim params --bus can0 set params.toml --save",
            "host-sim params --bus can0 set compensator.scale=0.5",
        ],
    ),
    (
        "params diff",
        [
            "host-sim params --bus can0 diff params.toml",
            "host-sim params --bus can0 --node-id 3 diff params.toml --json",
        ],
    ),
    (
        "params save",
        ["host-sim params --bus can0 save", "host-sim params --bus can0 --node-id 3 save"],
    ),
    (
        "params restore",
        ["host-sim params --bus can0 restore", "host-sim params --bus can0 --node-id 3 restore"],
    ),
    (
        "params status",
        ["host-sim params --bus can0 status", "host-sim params --bus loop status --json"],
    ),
    (
        "params arm",
        ["host-sim params --bus can0 arm", "host-sim params --bus can0 --node-id 3 arm"],
    ),
    (
        "params disarm",
        ["host-sim params --bus can0 disarm", "host-sim params --bus can0 --node-id 3 disarm"],
    ),
    (
        "params clear",
        ["host-sim params --bus can0 clear", "host-sim params --bus can0 --node-id 3 clear"],
    ),
    (
        "params home",
        [
            "host-sim params --bus can0 home                # here is 0 rad",
            "host-sim params --bus can0 home -1.571         # at the end stop",
        ],
    ),
    (
        "params commission",
        [
            "host-sim params --bus can0 commission --measure         # THE JOINT MOVES",
            "host-sim params --bus can0 commission --friction-run    # THE JOINT MOVES",
        ],
    ),
    (
        "params reset",
        ["host-sim params --bus can0 reset", "host-sim params --bus can0 --node-id 3 reset"],
    ),
    (
        "monitor",
        ["host-sim monitor --bus can0", "host-sim monitor --bus can0 --listen --json --seconds 60"],
    ),
    (
        "scope",
        [
            "host-sim scope --bus can0 --signals current_a,velocity_rad_s",
            "host-sim scope --bus can0 --signals current_a,torque_nm --trigger 'current_a<-2'",
        ],
    ),
    (
        "access",
        ["host-sim access --bus can0 status", "host-sim access --bus can0 set-key joint.key"],
    ),
    (
        "access status",
        ["host-sim access --bus can0 status", "host-sim access --bus can0 --node-id 3 status"],
    ),
    (
        "access lock",
        ["host-sim access --bus can0 lock", "host-sim access --bus can0 --node-id 3 lock"],
    ),
    (
        "access set-key",
        [
            "host-sim access --bus can0 set-key joint.key",
            "host-sim access --bus can0 --key old.key set-key joint.key",
        ],
    ),
    (
        "access policy",
        [
            "host-sim access --bus can0 policy locked",
            "host-sim access --bus can0 --key joint.key policy open",
        ],
    ),
    (
        "sign",
        [
            "host-sim sign --new-key maker.key              # once",
            "host-sim sign slot-a.elf slot-b.elf --key maker.key --version 1.2.0 --counter 3",
        ],
    ),
    (
        "update",
        [
            "host-sim update joint.package --bus can0",
            "host-sim update joint.package --bus can0 --node-id 3 --allow-older",
        ],
    ),
];

/// Returns the command with its examples and those of its subcommands at the beginning of the help. `path` is the
/// command's path below `host-sim`.
pub fn with_examples(command: Command, path: &str) -> Command {
    let own = EXAMPLES.iter().find(|(of, _)| *of == path);
    let command = match own {
        Some((_, [first, second])) => {
            command.before_help(format!("Examples:\n  {first}\n  {second}"))
        }
        None => command,
    };
    command.mut_subcommands(|below| {
        let name = below.get_name().to_owned();
        with_examples(below, format!("{path} {name}").trim_start())
    })
}
