"""The protocol over a bus that loses messages: executed once, complete, or a clear error."""

import random
import unittest

from carom import ComputationFailed, NoServer, Refused, ServerTimeout, SessionLost
from carom.calls import PublishedSteps
from carom.exchange import PIECE_BYTES, Exchange, Protocol, session_request
from carom.messages import (
    parameter_gradient_t,
    reply_t,
    scene_chunk_t,
    scene_t,
    state_t,
    step_request_t,
)


class Bus:
    """A server of the rules of docs/protocol.md, a clock, and a network that loses messages."""

    def __init__(self, loss=0.0, seed=1):
        self.now = 0.0
        self.random = random.Random(seed)
        self.loss = loss
        self.protocol = Protocol(self.publish, clock=lambda: self.now)
        self.sent = 0
        self.silent = False
        self.boot_id = 77
        self.window = 8
        self.next_seq = 1
        self.step = 0
        self.answers = {}  # seq -> [(channel, message)]
        self.executed = []
        self.pieces = {}
        self.fail_at = None
        self.lose_states = set()  # steps whose states are lost once

    # --- network

    def publish(self, channel, data):
        self.sent += 1
        if not self.silent and self.random.random() >= self.loss:
            self.take(channel, data)

    def answer(self, channel, message):
        if channel == "CAROM_STATE" and message.step in self.lose_states:
            self.lose_states.remove(message.step)
            return
        if self.random.random() >= self.loss:
            self.protocol.receive(channel, message.encode())

    def wait(self, exchange):
        while not exchange.done:
            self.now = max(self.now, self.protocol.next_time())
            self.protocol.poll()
        return exchange

    # --- server

    def reply(self, message, code, **fields):
        out = reply_t()
        out.client_id, out.session, out.seq = message.client_id, message.session, message.seq
        out.reply_code, out.boot_id, out.step, out.next_seq = code, self.boot_id, self.step, self.next_seq
        out.chunk_index, out.window = -1, self.window
        for name, value in fields.items():
            setattr(out, name, value)
        return out

    def take(self, channel, data):
        types = {"CAROM_STEP": step_request_t, "CAROM_SCENE": scene_t, "CAROM_SCENE_CHUNK": scene_chunk_t}
        message = types[channel].decode(data)
        if channel == "CAROM_SCENE_CHUNK":
            message = self.assemble(message)
            if message is None:
                return
        if message.seq > self.next_seq:
            self.answer("CAROM_REPLY", self.reply(message, reply_t.GAP))
            return
        if message.seq == self.next_seq:
            self.next_seq += 1
            self.answers[message.seq] = self.execute(message)
        resend = set(getattr(message, "resend_step", ()))
        for channel, answer in self.answers[message.seq]:
            if channel == "CAROM_STATE" and resend and answer.step not in resend:
                continue
            self.answer(channel, answer)

    def assemble(self, piece):
        if piece.seq < self.next_seq:
            for channel, answer in self.answers[piece.seq]:
                self.answer(channel, answer)
            return None
        self.pieces[piece.chunk_offset] = bytes(piece.chunk_data)
        whole = b"".join(self.pieces[k] for k in sorted(self.pieces))
        if len(whole) == piece.scene_bytes:
            return scene_t.decode(whole)
        self.answer("CAROM_REPLY", self.reply(piece, reply_t.CHUNK, chunk_index=piece.chunk_index))
        return None

    def execute(self, message):
        self.executed.append(message.seq)
        if isinstance(message, scene_t):
            self.step = 0
            return [("CAROM_REPLY", self.reply(message, reply_t.OK))]
        if message.from_step != self.step:
            return [("CAROM_REPLY", self.reply(message, reply_t.MISMATCH, reply_text="other step"))]
        code, end = reply_t.OK, self.step + message.num_steps
        if self.fail_at is not None and end > self.fail_at:
            code, end = reply_t.FAILED, self.fail_at
        steps = [s for s in PublishedSteps(self.step, message.num_steps, message.publish_every)
                 if s <= end]
        self.step = end
        out = []
        for s in sorted({*steps, end}):
            state = state_t()
            state.client_id, state.session, state.seq = message.client_id, message.session, message.seq
            state.step = s
            out.append(("CAROM_STATE", state))
        return [*out, ("CAROM_REPLY", self.reply(message, code, reply_text="broke"))]

    # --- client

    def open(self, name=""):
        message = scene_t()
        message.scene_name = name
        return self.protocol.start(self.protocol.scene(message))

    def steps(self, count, every=1, on_state=None):
        message = step_request_t()
        message.from_step = self.protocol.planned_step
        message.num_steps, message.publish_every = count, every
        wanted = PublishedSteps(message.from_step, count, every)
        self.protocol.planned_step += count
        return self.protocol.start(Exchange("CAROM_STEP", message, wanted, on_state=on_state))


class Loss(unittest.TestCase):
    def test_everything_happens_once(self):
        for seed in range(20):
            bus = Bus(loss=0.3, seed=seed)
            bus.wait(bus.open())
            seen = []
            for _ in range(10):
                exchange = bus.wait(bus.steps(7, every=2, on_state=lambda m: seen.append(m.step)))
                self.assertIsNone(exchange.error)
            self.assertEqual(bus.executed, list(range(1, 12)))
            self.assertEqual(seen, [s for k in range(10) for s in PublishedSteps(7 * k, 7, 2)])
            self.assertEqual(bus.protocol.step, 70)
            self.assertGreater(bus.protocol.repeated, 0)

    def test_several_under_way(self):
        for seed in range(20):
            bus = Bus(loss=0.3, seed=seed)
            bus.wait(bus.open())
            under_way = [bus.steps(5, every=0) for _ in range(20)]
            for exchange in under_way:
                bus.wait(exchange)
                self.assertIsNone(exchange.error)
            self.assertEqual(bus.executed, list(range(1, 22)))
            self.assertEqual(bus.protocol.step, 100)

    def test_no_more_than_the_window(self):
        bus = Bus()
        bus.window = 3
        bus.wait(bus.open())
        bus.silent = True
        under_way = [bus.steps(1) for _ in range(10)]
        self.assertEqual(sum(e.sent for e in under_way), 3)
        bus.silent = False
        for exchange in under_way:
            self.assertIsNone(bus.wait(exchange).error)

    def test_large_scenes_go_in_pieces(self):
        for loss in (0.0, 0.3):
            bus = Bus(loss=loss, seed=3)
            exchange = bus.wait(bus.open("x" * (20 * PIECE_BYTES)))
            self.assertIsNone(exchange.error)
            self.assertEqual(bus.executed, [1])
            self.assertEqual(len(bus.pieces), 21)

    def test_a_scene_above_the_limit_is_refused(self):
        with self.assertRaisesRegex(Refused, "a server takes 4194304"):
            Bus().open("x" * (5 << 20))

    def test_only_missing_states_are_asked_for(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.lose_states = {3, 5}
        exchange = bus.wait(bus.steps(6))
        self.assertEqual(list(exchange.message.resend_step), [3, 5])
        self.assertEqual(bus.protocol.resent, 2)
        self.assertEqual(sorted(exchange.states), [1, 2, 3, 4, 5, 6])
        self.assertEqual(bus.executed, [1, 2])


class Timing(unittest.TestCase):
    def test_repetitions_grow_and_end(self):
        bus = Bus()
        bus.silent = True
        times = []
        publish = bus.protocol._publish
        bus.protocol._publish = lambda *packet: (times.append(bus.now), publish(*packet))
        exchange = bus.wait(bus.open())
        self.assertIsInstance(exchange.error, NoServer)
        gaps = [b - a for a, b in zip(times, times[1:])]
        wanted = [min(0.02 * 1.5**k, 0.5) for k in range(len(gaps))]
        for gap, want in zip(gaps, wanted):
            self.assertAlmostEqual(gap, want, delta=1e-9)
        self.assertAlmostEqual(bus.now, 10, delta=1e-9)

    def test_silence_after_an_answer_is_a_timeout(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.silent = True
        self.assertIsInstance(bus.wait(bus.steps(1)).error, ServerTimeout)


    def test_an_answer_that_never_comes_is_a_timeout(self):
        bus = Bus()
        bus.wait(bus.open())
        message = step_request_t()
        exchange = bus.protocol.start(Exchange("CAROM_STEP", message, needs="CAROM_PARAMETER_GRADIENT"))
        self.assertIsInstance(bus.wait(exchange).error, ServerTimeout)
        self.assertAlmostEqual(bus.now, 10, delta=0.1)
        self.assertLess(exchange.sent, 40)  # repetitions grow to two a second


class Refusals(unittest.TestCase):
    def test_messages_of_another_version(self):
        bus = Bus()
        bus.silent = True
        exchange = bus.open()
        reply = bus.reply(exchange.message, reply_t.OK).encode()
        bus.protocol.receive("CAROM_REPLY", b"12345678" + reply[8:])
        self.assertRegex(str(exchange.error), "make the types again with: python -m carom.build_messages")

    def test_failed_computation_keeps_its_states(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.fail_at = 5
        exchange = bus.wait(bus.steps(10, every=2))
        self.assertIsInstance(exchange.error, ComputationFailed)
        self.assertEqual([s.step for s in exchange.error.states], [2, 4, 5])
        self.assertEqual(bus.protocol.planned_step, 5)

    def test_mismatch(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.protocol.planned_step = 3
        self.assertIsInstance(bus.wait(bus.steps(1)).error, Refused)

    def test_a_request_that_was_not_taken_frees_its_number(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.silent = True
        first, second = bus.steps(1), bus.steps(1)
        reply = bus.reply(first.message, reply_t.LIMIT, reply_text="too large")
        bus.protocol.receive("CAROM_REPLY", reply.encode())
        self.assertIsInstance(first.error, Refused)
        self.assertIsInstance(second.error, Refused)
        bus.silent = False
        self.assertIsNone(bus.wait(bus.steps(1)).error)
        self.assertEqual(bus.executed, [1, 2])

    def test_another_boot_loses_the_session(self):
        bus = Bus()
        bus.wait(bus.open())
        bus.boot_id = 78
        self.assertIsInstance(bus.wait(bus.steps(1)).error, SessionLost)
        self.assertTrue(bus.protocol.lost)

    def test_no_session(self):
        bus = Bus()
        bus.wait(bus.open())
        exchange = bus.steps(1)
        message = bus.reply(exchange.message, reply_t.NO_SESSION)
        exchange.done = False
        bus.protocol.pending[exchange.message.seq] = exchange
        bus.protocol.receive("CAROM_REPLY", message.encode())
        self.assertIsInstance(exchange.error, SessionLost)

    def test_strangers_and_noise_are_ignored(self):
        bus = Bus()
        bus.silent = True
        exchange = bus.open()
        for client, session in ((1, 1), (bus.protocol.client_id, 9)):
            other = bus.reply(exchange.message, reply_t.OK)
            other.client_id, other.session = client, session
            bus.protocol.receive("CAROM_REPLY", other.encode())
        bus.protocol.receive("CAROM_REPLY", b"noise")
        bus.protocol.receive("CAROM_ELSE", parameter_gradient_t().encode())
        self.assertFalse(exchange.done)

    def test_keep_alive_has_no_number(self):
        bus = Bus()
        bus.silent = True
        exchange = Exchange("CAROM_SESSION", session_request("KEEP_ALIVE"))
        bus.protocol.start(exchange, numbered=False)
        self.assertEqual(exchange.message.seq, 0)


class Steps(unittest.TestCase):
    def test_published_steps(self):
        self.assertEqual(list(PublishedSteps(0, 6, 2)), [2, 4, 6])
        self.assertEqual(list(PublishedSteps(10, 5, 2)), [12, 14, 15])
        self.assertEqual(list(PublishedSteps(0, 5, 0)), [5])
        self.assertEqual(list(PublishedSteps(3, 0, 1)), [3])


if __name__ == "__main__":
    unittest.main()
