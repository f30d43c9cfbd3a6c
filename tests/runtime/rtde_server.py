"""A controller of Universal Robots on a socket, by the protocol that the maker publishes.

Real-Time Data Exchange, version 2 (universal-robots.com, *RTDE guide*): packages of a size
(uint16), a type (uint8) and a payload, big-endian, on port 30004; the dashboard server on 29999,
the realtime interface, to which a program is sent, on 30003. The program is that of ur_rtde 1.6,
whose registers it reads and writes.
"""

import asyncio
import re
import struct
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.synchronize import Event

import numpy as np

from runtime.library import Library, load

Door = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]

PERIOD = 0.002
SILENCE = 150
"""Periods; ur_rtde waits for minutes where data cease for good."""
HELD = "URSoftware 5.11.0.108249 (Dec 08 2022)"
READY, DONE = 1, 2
"""Register 0: ready for a command, done with one."""
STEP_TIME, STOP_SCRIPT = 26, 255
"""Commands of the program: write its period into a register, which leaves it ready; end."""
SERVO_RECIPE = 2
"""Input recipe of set-points: register 0 with the command, then six positions."""
TYPES = {
    r"actual_(q|qd|current|joint_voltage|current_as_torque)|target_(q|qd|qdd|current|moment)"
    r"|joint_(temperatures|control_output|position_deltas_ratio)|(actual|target)_TCP_.*"
    r"|ft_raw_wrench": "VECTOR6D",
    r"joint_mode": "VECTOR6INT32",
    r"actual_tool_accelerometer|elbow_(position|velocity)|payload_cog": "VECTOR3D",
    r"payload_inertia": "VECTOR6D",
    r"robot_mode|safety_mode|tool_output_voltage|(in|out)put_int_register_\d+": "INT32",
    r"(robot|safety)_status_bits|runtime_state|safety_status"
    r"|(in|out)put_bit_registers0_to_31|(in|out)put_bit_registers32_to_63": "UINT32",
    r"actual_digital_(in|out)put_bits": "UINT64",
    r"tool_(analog_input_types|output_mode|digital_output\d_mode)"
    r"|standard_analog_.*_types": "UINT8",
}
"""Types by names, as the guide lists them; what is not here is a DOUBLE."""
LAYOUT = {
    "VECTOR6D": "6d", "VECTOR3D": "3d", "VECTOR6INT32": "6i", "INT32": "i", "UINT32": "I",
    "UINT64": "Q", "UINT8": "B", "DOUBLE": "d",
}  # fmt: skip


def type_of(name: str) -> str:
    return next((kind for names, kind in TYPES.items() if re.fullmatch(names, name)), "DOUBLE")


def names_of(text: bytes) -> list[str]:
    return [name for name in text.decode().split(",") if name]


class Client:
    """One connection to port 30004, with what it asked for."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.writer, self.is_started = writer, False
        self.outputs: list[str] = []
        self.inputs: list[list[str]] = []

    def send(self, kind: str, payload: bytes) -> None:
        self.writer.write(struct.pack(">HB", 3 + len(payload), ord(kind)) + payload)


class Controller:
    """An arm that is at the set-point one period after it came; its currents are τ / K.

    Attributes:
        q, dq: of the arm.
        calls: commands of the program that are not set-points, and the end of the program.
        points: set-points in the order of arrival.
        silent_at, protective_at: number of the set-point from which `SILENCE` periods have no data,
            or at which the arm stops for safety.
    """

    def __init__(
        self,
        lib: Library,
        address: str,
        gains: np.ndarray,
        silent_at: int = 1 << 30,
        protective_at: int = 1 << 30,
    ) -> None:
        self.silent_at, self.protective_at = silent_at, protective_at
        self.silence = SILENCE
        self.lib, self.address, self.gains = lib, address, gains
        self.q, self.dq = lib.home.copy(), np.zeros(lib.n_joints)
        self.points: list[np.ndarray] = []
        self.calls: list[int] = []
        self.clients: list[Client] = []
        self.steps, self.state, self.runs = 0, 0, False
        self.target = self.q

    def values(self) -> dict[str, object]:
        stopped = len(self.points) >= self.protective_at
        torque = self.lib.bias_forces(self.q, self.dq, self.lib.pi0)
        return {
            "timestamp": 100.0 + self.steps * PERIOD,
            "actual_q": tuple(self.q),
            "actual_qd": tuple(self.dq),
            "actual_current": tuple(torque / self.gains),
            "robot_status_bits": 1 | 2 * self.runs,
            "safety_status_bits": 4 if stopped else 1,
            "runtime_state": 2 if self.runs else 1,
            "output_int_register_0": self.state,
            "output_double_register_0": PERIOD,
        }

    def step(self) -> None:
        self.steps += 1
        self.dq, self.q = (self.target - self.q) / PERIOD, self.target
        if len(self.points) >= self.silent_at and self.silence > 0:
            self.silence -= 1
            return
        values = self.values()
        for client in self.clients:
            if client.is_started:
                client.send("U", b"\x01" + self.packed(client.outputs, values))

    @staticmethod
    def packed(names: list[str], values: dict[str, object]) -> bytes:
        out = b""
        for name in names:
            layout = LAYOUT[type_of(name)]
            count = int(layout[0]) if layout[0].isdigit() else 1
            value = values.get(name, (0,) * count)
            out += struct.pack(">" + layout, *(value if isinstance(value, tuple) else (value,)))
        return out

    def received(self, client: Client, recipe: int, payload: bytes) -> None:
        """Registers of the program."""
        names = client.inputs[recipe - 1]
        numbers = struct.unpack(">" + "".join(LAYOUT[type_of(n)] for n in names), payload)
        command = numbers[0]
        if command == 0:
            self.state = READY
        elif recipe == SERVO_RECIPE:
            self.points.append(np.array(numbers[1:7]))
            if len(self.points) < self.protective_at:
                self.target = self.points[-1]
        else:
            self.calls.append(command)
            self.state = READY if command == STEP_TIME else DONE
            self.runs = self.runs and command != STOP_SCRIPT

    async def exchange(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Port 30004."""
        client = Client(writer)
        self.clients.append(client)
        while True:
            size, kind = struct.unpack(">HB", await reader.readexactly(3))
            payload, kind = await reader.readexactly(size - 3), chr(kind)
            if kind == "V":
                client.send("V", b"\x01")
            elif kind == "v":
                client.send("v", struct.pack(">4I", 5, 11, 0, 108249))
            elif kind == "O":
                client.outputs = names_of(payload[8:])
                client.send("O", b"\x01" + ",".join(map(type_of, client.outputs)).encode())
            elif kind == "I":
                client.inputs.append(names_of(payload))
                kinds = ",".join(map(type_of, client.inputs[-1]))
                client.send("I", bytes([len(client.inputs)]) + kinds.encode())
            elif kind in "SP":
                client.is_started = kind == "S"
                client.send(kind, b"\x01")
            elif kind == "U":
                self.received(client, payload[0], payload[1:])

    async def dashboard(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Port 29999."""
        writer.write(b"Connected: Universal Robots Dashboard Server\n")
        answers = {"polyscopeversion": HELD, "is in remote control": "true"}
        while line := await reader.readline():
            writer.write(f"{answers.get(line.decode().strip().lower(), '20225500001')}\n".encode())

    async def program(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Port 30003."""
        while await reader.read(1 << 16):
            self.state, self.runs = READY, True

    async def serve(self, listening: Event) -> None:
        """Serve the three ports and move the arm, for ever."""
        doors: dict[int, Door] = {
            30004: self.exchange, 29999: self.dashboard, 30003: self.program,
        }  # fmt: skip
        for port, door in doors.items():
            await asyncio.start_server(partial(self.open, door), self.address, port)
        listening.set()
        begin = asyncio.get_running_loop().time()
        while True:
            self.step()
            late = asyncio.get_running_loop().time() - begin - self.steps * PERIOD
            await asyncio.sleep(max(-late, 0.0))

    async def open(
        self, door: Door, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """One connection, until it ends."""
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            await door(reader, writer)
        self.clients = [c for c in self.clients if c.writer is not writer]
        writer.close()


def _served(
    name: str, address: str, gains: np.ndarray, words: dict[str, int], listening: Event,
    asked: Connection,
) -> None:  # fmt: skip
    """A process with one arm, which answers with its set-points and calls when it is asked."""
    controller = Controller(load(name), address, gains, **words)

    async def run() -> None:
        serving = asyncio.create_task(controller.serve(listening))
        while not asked.poll():
            await asyncio.sleep(0.02)
        asked.send((np.array(controller.points), controller.calls))
        serving.cancel()

    asyncio.run(run())


@dataclass
class Served:
    """A controller in a process of its own, since ur_rtde waits with the interpreter locked."""

    process: BaseProcess
    asked: Connection

    def received(self) -> tuple[np.ndarray, list[int]]:
        """End it; set-points and the other commands that it received."""
        self.asked.send(None)
        assert self.asked.poll(10.0)
        return self.asked.recv()


@contextmanager
def controller(name: str, address: str, gains: np.ndarray, **words: int) -> Iterator[Served]:
    """A controller of the robot `name` at `address`, any of 127.0.0.0/8."""
    context = get_context("spawn")
    listening, (asked, answers) = context.Event(), context.Pipe()
    process = context.Process(
        target=_served, args=(name, address, gains, words, listening, answers), daemon=True
    )
    process.start()
    try:
        assert listening.wait(60.0)
        yield Served(process, asked)
    finally:
        process.kill()
        process.join()
