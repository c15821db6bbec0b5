"""The protocol without its transport: requests, their repetition, and what answers them.

An effect happens once however often its request arrives: requests carry (client_id, session, seq)
and are repeated after 20 ms, then 1.5 times as long each time, at most 500 ms, until they are
answered; 10 s without anything new are a timeout.  States that did not arrive are asked for again
by step.
"""

from __future__ import annotations

import math
import secrets
import struct
import time

from .errors import CaromError, ComputationFailed, NoServer, Refused, ServerTimeout, SessionLost
from .messages import (
    parameter_gradient_t,
    reply_t,
    scene_chunk_t,
    scene_t,
    session_request_t,
    state_t,
)
from .results import state_of

FIRST_WAIT = 0.02  # [s]
GROWTH = 1.5
LONGEST_WAIT = 0.5  # [s]
PIECE_BYTES = 60000  # larger scenes go in pieces of this size
PIECES_AT_ONCE = 8
MOST_RESENT = 1000  # states asked for again in one request
LARGEST_SCENE = 4 << 20  # [bytes]

ANSWERS = {"CAROM_STATE": state_t, "CAROM_PARAMETER_GRADIENT": parameter_gradient_t,
           "CAROM_SCENE_UPDATED": scene_t, "CAROM_REPLY": reply_t}

# Fingerprint, utime, client_id, session and seq: how every message starts.
HEAD = struct.Struct(">8sqqiq")

START = "start it with: caromd"


class Exchange:
    """One request until its answer is complete."""

    def __init__(self, channel, message, steps=(), needs=None, on_state=None):
        self.channel = channel
        self.message = message
        self.steps = steps  # of the states that are expected
        self.needs = needs  # channel of the one other answer that is expected
        self.on_state = on_state
        self.states = {}
        self.answer = None
        self.reply = None
        self.error = None
        self.done = False
        self.sent = 0
        self.next_send = 0.0
        self.wait = FIRST_WAIT
        self.deadline = 0.0
        self.delivered = 0  # states handed to on_state

    def missing(self):
        """Steps of the states that did not arrive, as far as the computation came."""
        wanted = self.steps
        if self.steps and self.reply and self.reply.reply_code == reply_t.FAILED:
            last = self.reply.step  # the state where it stopped is published as well
            wanted = sorted({s for s in self.steps if s <= last} | {last})
        return [s for s in wanted if s not in self.states]

    def packets(self):
        """What one transmission consists of: (channel, bytes)."""
        return [(self.channel, self.message.encode())]

    def acknowledge(self, reply):
        """A piece arrived; nothing to do for a request of one piece."""

    def take_states(self):
        """States that are complete in order, for the callback."""
        while self.on_state and self.delivered < len(self.steps):
            state = self.states.get(self.steps[self.delivered])
            if state is None:
                return
            self.delivered += 1
            self.on_state(state)


class PiecedExchange(Exchange):
    """A scene above 60 KB: pieces that are acknowledged one by one."""

    def __init__(self, message, data):
        super().__init__("CAROM_SCENE", message)
        self.data = data
        self.pending = list(range(-(-len(data) // PIECE_BYTES)))

    def packets(self):
        return [("CAROM_SCENE_CHUNK", self._piece(k)) for k in self.pending[:PIECES_AT_ONCE] or [0]]

    def acknowledge(self, reply):
        if reply.chunk_index in self.pending:
            self.pending.remove(reply.chunk_index)
            if self.pending:
                self.wait = FIRST_WAIT
                self.next_send = 0.0

    def _piece(self, k):
        piece = scene_chunk_t()
        for name in ("utime", "client_id", "session", "seq"):
            setattr(piece, name, getattr(self.message, name))
        piece.scene_bytes = len(self.data)
        piece.chunk_stride = PIECE_BYTES
        piece.chunk_index = k
        piece.chunk_offset = k * PIECE_BYTES
        piece.chunk_data = self.data[piece.chunk_offset:piece.chunk_offset + PIECE_BYTES]
        piece.num_bytes = len(piece.chunk_data)
        return piece.encode()


class Protocol:
    """A session with a server.  `publish(channel, bytes)` sends; the owner calls `receive` with what
    arrives and `poll` when `next_time` has come."""

    def __init__(self, publish, name="", timeout=10.0, clock=time.monotonic, session=1, where=""):
        self.suffix = f"_{name}" if name else ""
        self.timeout = timeout
        self.session = session
        self.client_id = secrets.randbits(63)
        self.boot_id = None
        self.lost = False  # the session is gone: the next scene starts another
        self.step = 0  # the session is at, as far as answered
        self.planned_step = 0  # after the requests under way
        self.first_step = 0  # at which the tape starts
        self.window = 8  # requests that may be under way at once
        self.snapshots = {}  # number -> step
        self.repeated = 0  # requests sent again
        self.resent = 0  # states asked for again
        self._publish = publish
        self._clock = clock
        self._where = where
        self._seq = 0
        self._settled = 0  # largest seq whose reply set `step`
        self._heard = False
        self.pending: dict[int, Exchange] = {}

    # --- requests

    def start(self, exchange, numbered=True):
        """Gives the request its number and sends it."""
        message = exchange.message
        if numbered:
            self._seq += 1
            message.seq = self._seq
        message.client_id = self.client_id
        message.session = self.session
        message.utime = time.time_ns() // 1000
        self.pending[message.seq] = exchange
        exchange.deadline = self._clock() + self.timeout
        exchange.next_send = math.inf
        self._send_waiting()
        return exchange

    def _send_waiting(self):
        """Sends requests for the first time, in order, as far as the server's window goes."""
        under_way = sum(e.sent > 0 for e in self.pending.values())
        for seq in sorted(self.pending):
            if self.pending[seq].sent == 0 and under_way < self.window:
                self._send(self.pending[seq], self._clock())
                under_way += 1

    def scene(self, message):
        """The exchange of a scene: in pieces when it is large."""
        data = self._stamped(message).encode()
        if len(data) > LARGEST_SCENE:
            raise Refused(f"the scene takes {len(data)} bytes; a server takes {LARGEST_SCENE}")
        if len(data) > PIECE_BYTES:
            return PiecedExchange(message, data)
        return Exchange("CAROM_SCENE", message)

    def _stamped(self, message):
        """The head that `start` gives, ahead of time: pieces are cut from the encoded scene."""
        message.seq = self._seq + 1
        message.client_id = self.client_id
        message.session = self.session
        return message

    def _send(self, exchange, now):
        if exchange.reply is not None and exchange.steps:
            missing = exchange.missing()[:MOST_RESENT]  # the rest is there, or comes later
            exchange.message.resend_step = missing
            exchange.message.num_resend = len(missing)
            self.resent += len(missing)
        for channel, data in exchange.packets():
            self._publish(channel + self.suffix, data)
        if exchange.sent:
            self.repeated += 1
        exchange.sent += 1
        exchange.next_send = now + exchange.wait
        exchange.wait = min(exchange.wait * GROWTH, LONGEST_WAIT)

    # --- time

    def next_time(self):
        """When `poll` wants to be called, on the clock; None when nothing is under way."""
        times = [min(e.next_send, e.deadline) for e in self.pending.values()]
        return min(times) if times else None

    def poll(self):
        """Repeats what is due and gives up what is too late."""
        now = self._clock()
        for exchange in list(self.pending.values()):
            if now >= exchange.deadline:
                self._fail(exchange, self._timeout_error())
            elif now >= exchange.next_send:
                self._send(exchange, now)

    def _timeout_error(self):
        if self._heard:
            return ServerTimeout(f"no answer from the server for {self.timeout:g} s")
        return NoServer(f"no answer from a server{self._where} within {self.timeout:g} s; {START}")

    # --- answers

    def receive(self, channel, data):
        """Takes a message that arrived."""
        kind = channel[:len(channel) - len(self.suffix)] if self.suffix else channel
        try:
            message = ANSWERS[kind].decode(data)
        except KeyError:
            return
        except (ValueError, struct.error):
            self._take_foreign(kind, data)
            return
        if message.client_id != self.client_id or message.session != self.session:
            return
        self._heard = True
        exchange = self.pending.get(message.seq)
        if kind == "CAROM_REPLY":
            self._take_reply(message, exchange)
        elif exchange is not None:
            self._take_answer(kind, message, exchange)

    def _take_foreign(self, kind, data):
        """Noise is passed over.  A message to us of another fingerprint is no noise."""
        if len(data) < HEAD.size or data[:8] == ANSWERS[kind]._get_packed_fingerprint():
            return
        if HEAD.unpack_from(data)[2:4] == (self.client_id, self.session):
            self._fail_all(list(self.pending.values()), CaromError(
                f"the server's messages on {kind} are not those of this package; make the types "
                "again with: python -m carom.build_messages"))

    def _renew(self):
        """A sign of life that brought something: all requests may wait on."""
        for exchange in self.pending.values():
            exchange.deadline = self._clock() + self.timeout

    def _take_answer(self, kind, message, exchange):
        if kind == "CAROM_STATE":
            if message.step in exchange.states:
                return
            exchange.states[message.step] = message
            exchange.take_states()
        elif kind == exchange.needs:
            exchange.answer = message
        self._renew()
        self._complete(exchange)

    def _take_reply(self, reply, exchange):
        if self.boot_id not in (None, reply.boot_id):
            self._lose("the server was started again; open the scene once more")
            return
        self.boot_id = reply.boot_id
        self.window = max(1, reply.window)
        if reply.reply_code == reply_t.NO_SESSION:
            self._lose(f"{reply.reply_text or 'the session expired'}; open the scene once more")
        elif reply.reply_code == reply_t.GAP:
            self._fill_gap(reply)
        elif exchange is not None:
            self._settle(reply, exchange)

    def _settle(self, reply, exchange):
        code = reply.reply_code
        if code in (reply_t.OK, reply_t.FAILED):
            self._take_end(reply, exchange)
        elif code == reply_t.CHUNK:
            self._renew()
            exchange.acknowledge(reply)
        elif code == reply_t.PENDING:
            self._renew()
            exchange.wait = LONGEST_WAIT
        elif code == reply_t.BUSY:
            self._renew()  # not taken: it is sent again in its time
        elif code in (reply_t.MALFORMED, reply_t.LIMIT):
            self._withdraw(exchange, Refused(reply.reply_text or f"reply code {code}"))
        elif code == reply_t.FORGOTTEN:
            self._fail(exchange, SessionLost("the answer is no longer kept by the server"))
        else:
            self._fail(exchange, Refused(reply.reply_text or f"reply code {code}"))

    def _take_end(self, reply, exchange):
        """The request is executed; what came before the reply may have been lost."""
        is_first = exchange.reply is None
        if is_first:
            self._renew()
        exchange.reply = reply
        self._complete(exchange)
        if is_first and not exchange.done:
            exchange.wait = FIRST_WAIT
            exchange.next_send = min(exchange.next_send, self._clock() + FIRST_WAIT)

    def _complete(self, exchange):
        """Done when reply, states and answer are all there."""
        reply = exchange.reply
        if reply is None or exchange.done or exchange.missing():
            return
        failed = reply.reply_code == reply_t.FAILED
        if exchange.needs and exchange.answer is None and not failed:
            return
        if reply.seq >= self._settled:
            self._settled = reply.seq
            self.step = reply.step
            self.first_step = reply.first_step
        if failed:
            states = [state_of(exchange.states[s]) for s in sorted(exchange.states)]
            self._fail(exchange, ComputationFailed(reply.reply_text, states))
        else:
            self._finish(exchange)

    def _withdraw(self, exchange, error):
        """The request was not taken: its number is free again, and what follows it goes with it."""
        seq = exchange.message.seq
        self._fail_all([e for s, e in self.pending.items() if s >= seq], error)
        self._seq = seq - 1

    def _fill_gap(self, reply):
        """An earlier request did not arrive: it is sent again at once, unless it was answered since."""
        first = self.pending.get(reply.next_seq)
        if first is not None:
            self._renew()
            first.next_send = 0.0

    def _lose(self, text):
        self._fail_all(list(self.pending.values()), SessionLost(text))
        self.boot_id = None
        self.lost = True

    def _fail_all(self, exchanges, error):
        for exchange in exchanges:
            self.pending.pop(exchange.message.seq)
        for exchange in exchanges:
            self._fail(exchange, error)

    def _fail(self, exchange, error):
        exchange.error = error
        self.planned_step = self.step
        self._finish(exchange)

    def _finish(self, exchange):
        exchange.done = True
        self.pending.pop(exchange.message.seq, None)
        self._send_waiting()

    def renew_session(self):
        """After a loss: the next scene opens a session of another number, counting from 1."""
        self.session += 1
        self.lost = False
        self._seq = self._settled = 0
        self.step = self.planned_step = self.first_step = 0


def session_request(action, snapshot=0, lease=-1.0):
    """A session_request_t by the name of its action."""
    message = session_request_t()
    message.session_action = getattr(session_request_t, action)
    message.snapshot = snapshot
    message.lease = lease
    return message


def check(exchange):
    """Raises what the exchange ended with."""
    if exchange.error is not None:
        raise exchange.error
    if not exchange.done:
        raise CaromError("the request is still under way")
