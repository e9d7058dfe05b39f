#!/bin/sh
# needs: test:host-sim/bus
# limit: 180
# The bus of host-sim on a real interface, against candump, cansend and canplayer.
exec "$TEST_HOST_SIM_BUS" bus_socketcan:: --show-output
