#!/bin/sh
# needs: host-sim eds python
# limit: 120
# A master that knows drives and no joints: python-canopen's profile of CiA 402, with joint.eds.
''':'
exec "$PYTHON" "$0"
'''
import os
import threading
import time

import canopen
from bench import INTERFACE, Node, equal, passed, test, until
from canopen.profiles.p402 import BaseNode402

EDS = os.environ["JOINT_EDS"]
RATED_A = 26.0
SAFE, ARMED = 0, 1


class Master:
    """A network with one drive, and SYNCs with a counter (1019h) a hundred times a second."""

    def __init__(self, *arguments):
        self.process = Node(*arguments)
        self.network = canopen.Network()
        self.network.connect(interface="socketcan", channel=INTERFACE)
        self.drive = BaseNode402(1, EDS)
        self.network.add_node(self.drive)
        # A busy machine answers late.
        self.drive.sdo.RESPONSE_TIMEOUT = 3.0
        self.running = False
        self.repeats_target = False

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.stop_sync()
        self.network.disconnect()
        self.process.__exit__(*exception)

    def start_sync(self):
        def send():
            count = 0
            while self.running:
                count = count % 240 + 1
                self.network.sync.transmit(count)
                if self.repeats_target:
                    self.drive.rpdo[1].transmit()
                time.sleep(0.01)

        self.running = True
        self.thread = threading.Thread(target=send, daemon=True)
        self.thread.start()

    def begin(self):
        """Into operation, with SYNCs."""
        self.drive.nmt.state = "PRE-OPERATIONAL"
        time.sleep(0.3)
        self.drive.setup_402_state_machine()
        self.drive.nmt.state = "OPERATIONAL"
        self.start_sync()

    def follow(self, name, target):
        """Sends a target with every SYNC, as a cyclic master does: a SYNC alone does not keep a drive enabled (1400h:5)."""
        self.drive.rpdo[1]["controlword"].raw = 0x0F
        self.drive.rpdo[1][name].raw = target
        self.repeats_target = True

    def stop_sync(self):
        if self.running:
            self.running = False
            self.thread.join()


@test
def a_master_brings_the_joint_up_through_cst_to_a_stop():
    with Master() as master:
        drive = master.drive
        equal(drive.sdo[0x1000].raw, 0x00020192)
        # The friction's frame away, the drive's in its place.
        drive.sdo[0x1800][1].raw = 0x80000181
        drive.sdo[0x1805][1].raw = 0x40000181
        drive.nmt.state = "PRE-OPERATIONAL"
        time.sleep(0.1)
        drive.setup_402_state_machine()
        drive.nmt.state = "OPERATIONAL"
        master.start_sync()
        assert drive.is_op_mode_supported("CYCLIC SYNCHRONOUS TORQUE")
        drive.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        equal(drive.op_mode, "CYCLIC SYNCHRONOUS TORQUE")
        until(lambda: drive.state == "SWITCH ON DISABLED", "the first state")
        drive.state = "OPERATION ENABLED"
        equal(drive.sdo["state"]["state"].raw, ARMED)
        # A tenth of the rated torque, in the frame that also holds the controlword.
        master.follow("target_torque", -100)
        current = lambda: drive.sdo["outputs"]["current_a"].raw
        until(lambda: abs(current() + 0.1 * RATED_A) < 1e-3, f"a tenth of the rated current, not {current()} A")
        # A target that is repeated is a sign of life.
        time.sleep(0.5)
        equal(drive.state, "OPERATION ENABLED")
        drive.state = "SWITCH ON DISABLED"
        equal(drive.sdo["state"]["state"].raw, SAFE)


@test
def a_master_homes_the_joint_where_it_stands():
    with Master("--motor") as master:
        drive = master.drive
        master.begin()
        until(lambda: drive.state == "SWITCH ON DISABLED", "the first state")
        drive.sdo["home_offset"].raw = -500_000
        drive.sdo["homing_method"].raw = 37
        assert drive.is_op_mode_supported("HOMING")
        assert drive.homing(timeout=5), f"homed, not {drive.statusword:#06x}"
        assert drive.statusword & 1 << 8, "the position is known"
        position = lambda: 1e-6 * drive.sdo["position_actual_value"].raw
        until(lambda: abs(position() - 0.5) < 0.01, f"half a radian from the zero, not {position()} rad")
        drive.state = "SWITCH ON DISABLED"
        equal(drive.sdo["state"]["state"].raw, SAFE)


def velocity(drive):
    """What the drive measures, rad/s."""
    return 1e-6 * drive.sdo["velocity_actual_value"].raw


@test
def a_master_drives_a_simulated_motor_through_cst_and_csv_to_a_stop():
    with Master("--motor") as master:
        drive = master.drive
        master.begin()
        # CST: a quarter of the rated torque, which friction does not hold.
        drive.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        until(lambda: drive.state == "SWITCH ON DISABLED", "the first state")
        drive.state = "OPERATION ENABLED"
        master.follow("target_torque", 250)
        until(lambda: velocity(drive) > 1.0, f"it turns, not at {velocity(drive)} rad/s")
        drive.state = "SWITCH ON DISABLED"
        equal(drive.sdo["state"]["state"].raw, SAFE)
        until(lambda: abs(velocity(drive)) < 0.05, f"friction stops it, not {velocity(drive)} rad/s")
        # CSV: there and back, the target within the same frame.
        assert drive.is_op_mode_supported("CYCLIC SYNCHRONOUS VELOCITY")
        drive.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
        equal(drive.op_mode, "CYCLIC SYNCHRONOUS VELOCITY")
        drive.state = "OPERATION ENABLED"
        for wanted in (2.0, -1.0, 0.0):
            master.follow("target_velocity", round(1e6 * wanted))
            # Four samples in a row, for it passes through every velocity on its way.
            until(
                lambda: all(abs(velocity(drive) - wanted) < 0.1 for _ in range(4)),
                f"{wanted} rad/s, not {velocity(drive)}",
            )
            equal(drive.state, "OPERATION ENABLED")
        # Beyond 6080h it is held there: 487 turns of the motor in a minute are 1 rad/s.
        drive.state = "SWITCH ON DISABLED"
        drive.sdo["max_motor_speed"].raw = 487
        drive.state = "OPERATION ENABLED"
        master.follow("target_velocity", 5_000_000)
        until(lambda: all(abs(velocity(drive) - 1.0) < 0.1 for _ in range(8)), f"1 rad/s, not {velocity(drive)}")
        assert drive.statusword & 1 << 11, "the limit is said"
        # A quick stop opens the bridge, and the joint runs out.
        drive.controlword = 0x0B
        until(lambda: drive.sdo["state"]["state"].raw == SAFE, "quick stop")
        until(lambda: abs(velocity(drive)) < 0.05, f"it stops, not {velocity(drive)} rad/s")


@test
def a_master_that_falls_silent_is_a_fault_though_its_syncs_go_on():
    with Master("--motor") as master:
        drive = master.drive
        master.begin()
        drive.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
        until(lambda: drive.state == "SWITCH ON DISABLED", "the first state")
        drive.state = "OPERATION ENABLED"
        master.follow("target_velocity", 1_000_000)
        until(lambda: abs(velocity(drive) - 1.0) < 0.1, f"1 rad/s, not {velocity(drive)}")
        master.repeats_target = False
        until(lambda: drive.state == "FAULT", f"a fault, not {drive.state}", 2.0)
        until(lambda: abs(velocity(drive)) < 0.05, f"it stops, not {velocity(drive)} rad/s")


passed("drive_402")
