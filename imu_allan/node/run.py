# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One run: what belongs to it, and is left behind when another begins."""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.power_ons import boot_id, PowerOns
from imu_allan.node.replay import LoopWatch
from imu_allan.node.same_imu import ChangeWatch, Signature, Trial
from imu_allan.node.standards import Looks
from imu_allan.result import Result


@dataclass(frozen=True)
class Snapshot:
    """All that a run had taken in at a moment."""

    characterization: Characterization
    power_ons: PowerOns

    def result(self) -> Result:
        """Fit it."""
        return self.power_ons.entered(self.characterization.result(), self.characterization)


class Run:
    """
    A characterization, and what the node remembers about its samples.

    Parameters
    ----------
    characterization : Characterization
        New, or resumed.
    trial : Trial, optional
        Of a resumed one: messages are held back until it has passed.
    power_ons : PowerOns, optional
        Of a resumed one.

    Attributes
    ----------
    fed, fitted, checkpointed : int
        Messages it has been given, and how many of them are in the last fit and checkpoint.
    stamp_ns : int
        Of the last message.
    duration_s : float
        Time that the last fit spans.
    error : str
        Why the latest messages are of no use; empty while they are.
    over : bool
        Whether another has begun since.
    looks : Looks
        At how it stands to a datasheet, kept by the thread that fits.

    """

    def __init__(self, characterization: Characterization, trial: Trial | None = None,
                 power_ons: PowerOns | None = None) -> None:
        self.characterization = characterization
        self.power_ons = PowerOns(boot_id()) if power_ons is None else power_ons
        self.trial = trial
        self.fed = self.fitted = self.checkpointed = 0
        self.stamp_ns = 0
        self.duration_s = 0.0
        self.error = ''
        self.over = False
        self.looks = Looks()
        self._loop = LoopWatch()
        self._change = ChangeWatch(Signature())

    @property
    def looping(self) -> bool:
        """Whether the messages that come now have come before."""
        return self._loop.looping

    def snapshot(self) -> Snapshot:
        """Return an independent copy, which can be fitted in another thread."""
        return Snapshot(self.characterization.snapshot(), self.power_ons)

    def learn(self, result: Result) -> None:
        """Remember what a fit has told about the messages."""
        self.duration_s = result.timeline.duration_s
        self._change.signature = Signature(
            result.source.frame_id, result.timeline.sample_rate_hz, result.source.clock)

    def update(self, blocks: Sequence[ImuBlock]) -> None:
        """Take in messages; those that the timeline cannot use are told of in `error`."""
        blocks = self._loop.unseen(blocks)
        if blocks:
            self.error = ''
        for block in blocks:
            try:
                self.characterization.update(block)
            except ImuAllanError as error:
                self.error = str(error)
            self.fed += len(block)
            self.stamp_ns = int(block.header_ns[-1] or block.receive_ns[-1])

    def changed(self, blocks: Sequence[ImuBlock]) -> tuple[UnusableState, list[ImuBlock]] | None:
        """Tell of a change of rate or frame_id that has lasted, with the messages since."""
        verdict = self._change.look(blocks)
        return None if verdict is None else (verdict, self._change.changed)
