#!/bin/sh
# needs: test:bus_socketcan
# limit: 180
# The bus of host-sim on a real interface, against candump, cansend and canplayer.
exec "$TEST_BUS_SOCKETCAN" --show-output
