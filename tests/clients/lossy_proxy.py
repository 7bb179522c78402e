"""Between a vehicle and a ground station, losing datagrams: python lossy_proxy.py OURS VEHICLE STATION LOSS."""

import random
import select
import socket
import sys


def main() -> None:
    ours, vehicle, station, loss = (float(text) for text in sys.argv[1:])
    left = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    left.bind(("127.0.0.1", int(ours)))
    right = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    right.bind(("127.0.0.1", 0))
    ways = {left: (right, ("127.0.0.1", int(station))), right: (left, ("127.0.0.1", int(vehicle)))}
    rng = random.Random(1)
    while True:
        for one in select.select(list(ways), [], [])[0]:
            try:
                data = one.recv(4096)
                other, to = ways[one]
                if rng.random() >= loss:
                    other.sendto(data, to)
            except ConnectionRefusedError:
                continue


main()
