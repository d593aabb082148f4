#!/usr/bin/env python3
"""The live server under load: tools/load.py ALIDADE [--seconds N]. `observe - --live` answers rows as fast as they come, in phases with and
without 200 clients (most of them more than are served, those that are served do not read), half-open sockets and as many requests of no
meaning as this machine can send. What must hold: the answers are those of a run that nobody watches, to the byte; the thread that
estimates takes no more of the processor's time a row; memory is flat; who reads is served; nothing listens beyond loopback.

The run that nobody watches is fed in turn with the watched one, a few rows each, both estimate on the same processor, and what is judged is
the ratio of their times under load over the same ratio without: whatever else keeps the machine busy, attackers among it, slows both alike."""
import argparse
import base64
import multiprocessing
import os
import pathlib
import random
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

MESS = [b"\0\1\2\3", b"GET\r\n\r\n", b"A" * 20000, b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /" + b"%2e%2e/" * 300 + b" HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00"]


def connected(port):
    link = socket.create_connection(("127.0.0.1", port), timeout=2.0)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    return link


def subscribed(port):
    """A client that asks for all topics, and whether it is served."""
    link = connected(port)
    key = base64.b64encode(os.urandom(16)).decode()
    link.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                 f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode())
    if not link.recv(64).startswith(b"HTTP/1.1 101"):
        link.close()
        return None
    said = b'{"op":"subscribe","subscriptions":[' + b",".join(b'{"id":%d,"channelId":%d}' % (i, i) for i in range(1, 9)) + b"]}"
    link.sendall(bytes([0x81, 0x80 | 126, len(said) >> 8, len(said) & 255, 0, 0, 0, 0]) + said)
    return link


def attack(port, stop, sent, served, seed):
    """Clients that do not read, sockets that say half a request, and nonsense as fast as it goes."""
    os.nice(19)
    chance, kept = random.Random(seed), []
    for _ in range(100):
        try:
            link = subscribed(port)
            if link:
                kept.append(link)
        except OSError:
            pass
    served.value += len(kept)
    for _ in range(10):
        try:
            half = connected(port)
            half.sendall(b"GET / HTTP/1.1\r\nHost: ")
            kept.append(half)
        except OSError:
            pass
    while not stop.is_set():
        try:
            with connected(port) as link:
                link.sendall(chance.choice(MESS))
            sent.value += 1
        except OSError:
            pass
    for link in kept:
        link.close()


class Run:
    """`observe -`, and what its thread of the estimate has taken of the processor."""

    def __init__(self, alidade, log, folder, live):
        words = [alidade, "observe", "-", "--size", "780x582", "--no-report", "--keep-rows", "1000", "--out", folder]
        self.process = subprocess.Popen([*words, *(["--live=0"] if live else [])], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, bufsize=0)
        self.port = 0
        while live and not self.port:
            found = re.search(rb"live: http://127\.0\.0\.1:(\d+)/", self.process.stderr.readline())
            self.port = int(found.group(1)) if found else 0
        self.header, *self.rows = log.read_bytes().splitlines(keepends=True)
        self.given, self.answers = 0, []
        self.process.stdin.write(self.header)
        self.reader = threading.Thread(target=lambda: self.answers.extend(self.process.stdout))
        self.reader.start()

    def feed(self, count):
        """Rows in the order of the log, again and again, with times that go on; ns of processor a row, once all are answered."""
        before, said = self.nanoseconds(), b""
        for _ in range(count):
            _, _, rest = self.rows[self.given % len(self.rows)].partition(b",")
            said += b"%.6f," % (self.given / 30.0) + rest
            self.given += 1
        self.process.stdin.write(said)
        while len(self.answers) < self.given + 1 and self.process.poll() is None:
            time.sleep(0.0005)
        return (self.nanoseconds() - before) / count

    def nanoseconds(self):
        pid = self.process.pid
        return int(open(f"/proc/{pid}/task/{pid}/schedstat").read().split()[0])

    def memory_kb(self):
        return int(re.search(r"VmRSS:\s*(\d+)", open(f"/proc/{self.process.pid}/status").read()).group(1))

    def end(self):
        self.process.stdin.close()
        self.reader.join()
        self.process.stderr.close()
        return b"".join(self.answers[:self.given + 1])


def listens_beyond_loopback(pid):
    text = subprocess.run(["ss", "-ltnp"], capture_output=True, text=True).stdout
    return any(f"pid={pid}," in line and "127.0.0.1:" not in line for line in text.splitlines())


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=600.0)
    args = parser.parse_args()
    alidade = args.alidade.resolve()
    faults = []
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        subprocess.run([alidade, "simulate", "rotation", "--source", "head", "--points", "8", "--duration", "62.8", "--no-report", "--quiet",
                        "--out", folder / "sim"], check=True)
        log = folder / "sim" / "log.csv"
        watched, alone = Run(alidade, log, folder / "live", True), Run(alidade, log, folder / "alone", False)
        if listens_beyond_loopback(watched.process.pid):
            faults.append("it listens beyond loopback")
        # The estimating threads alone: one whose core has a busy neighbour takes half as long again as one whose has not.
        for run in (watched, alone):
            os.sched_setaffinity(run.process.pid, {min(os.sched_getaffinity(0))})
        count, quiet, loaded, memory = 100, [], [], []

        def pair():
            """ns of processor a row: watched, alone."""
            return watched.feed(count), alone.feed(count)

        sent, served = multiprocessing.Value("l", 0), multiprocessing.Value("l", 0)
        # Caches, and in the long campaign the rows' own memory, which has grown to its last fifth only after half a million.
        for _ in range(5000 if args.seconds >= 300 else 60):
            pair()
        begun, loaded_s = time.monotonic(), 0.0
        while time.monotonic() - begun < args.seconds or len(memory) < 2:
            quiet += [pair() for _ in range(100)]
            stop = multiprocessing.Event()
            attackers = [multiprocessing.Process(target=attack, args=(watched.port, stop, sent, served, len(memory) * 2 + i)) for i in (0, 1)]
            for attacker in attackers:
                attacker.start()
            time.sleep(1.0)
            phase, first = time.monotonic(), len(loaded)
            while time.monotonic() - phase < min(20.0, args.seconds / 4) or len(loaded) < first + 8:
                loaded.append(pair())
            loaded_s += time.monotonic() - phase + 1.0
            stop.set()
            for attacker in attackers:
                attacker.join()
            memory.append(watched.memory_kb())
            if subscribed(watched.port) is None:
                faults.append("who comes after the load is not served")
            time.sleep(0.2)
        answers, code = watched.end(), watched.process.wait()
        if alone.end() != answers:
            faults.append("the answers are not those of a run that nobody watches")
        if code != alone.process.wait():
            faults.append(f"exit code {code}")
    more = statistics.median(seen / unseen for seen, unseen in loaded) / statistics.median(seen / unseen for seen, unseen in quiet) - 1.0
    growth = max(memory) / memory[0] - 1.0
    if growth > 0.1:
        faults.append(f"memory grows by {100 * growth:.0f} %")
    if more > 0.1:
        faults.append(f"a row takes {100 * more:.0f} % more")
    print(f"load: {loaded_s:.0f} s of load, {sent.value} requests of no meaning ({sent.value / loaded_s:.0f} a second), 200 clients a phase of "
          f"which {served.value / max(1, len(memory)):.0f} are served; a row takes "
          f"{statistics.median(seen for seen, _ in quiet) / 1e3:.1f} us of the processor without and {100 * more:+.1f} % with it (medians of "
          f"{len(quiet)} and {len(loaded)} times {count} rows, each over the same rows of a run that nobody watches); "
          f"{memory[0] / 1024:.0f} MB, {100 * growth:+.1f} %" + "".join(f"; FAILS: {fault}" for fault in faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
