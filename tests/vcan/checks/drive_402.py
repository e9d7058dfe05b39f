#!/bin/sh
# needs: host-sim python
# limit: 120
# A master that knows drives and no joints: python-canopen's profile of CiA 402, with joint.eds.
''':'
exec "$PYTHON" "$0"
'''
import threading
import time

import canopen
from bench import INTERFACE, REPO, Node, equal, passed, test, until
from canopen.profiles.p402 import BaseNode402

EDS = str(REPO / "firmware" / "joint.eds")
RATED_A = 26.0
SAFE, ARMED = 0, 1


class Master:
    """A network with one drive, and SYNCs with a counter (1019h) a hundred times a second."""

    def __init__(self):
        self.process = Node()
        self.network = canopen.Network()
        self.network.connect(interface="socketcan", channel=INTERFACE)
        self.drive = BaseNode402(1, EDS)
        self.network.add_node(self.drive)
        self.running = False

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
                time.sleep(0.01)

        self.running = True
        self.thread = threading.Thread(target=send, daemon=True)
        self.thread.start()

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
        drive.rpdo[1]["controlword"].raw = 0x0F
        drive.rpdo[1]["target_torque"].raw = -100
        drive.rpdo[1].transmit()
        current = lambda: drive.sdo["outputs"]["current_a"].raw
        until(lambda: abs(current() + 0.1 * RATED_A) < 1e-3, f"a tenth of the rated current, not {current()} A")
        # What does not change is not sent again, and a SYNC is a sign of life.
        time.sleep(0.5)
        equal(drive.state, "OPERATION ENABLED")
        drive.state = "SWITCH ON DISABLED"
        equal(drive.sdo["state"]["state"].raw, SAFE)


passed("drive_402")
