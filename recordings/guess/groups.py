"""Columns that differ by their joint alone, and which joint each is of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

from ..joints import Joints
from ..table import Channel, Column, Table
from .names import ALONE_WORDS, MEASURED_WORDS, REFERENCE_WORDS, Name, parsed, quantity_of, quantity_word

Words = tuple[str, ...]

# Words that name any joint; with a number they name one.
GENERIC = {"joint", "joints", "j", "axis", "motor", "servo", "link", "dof"}


@dataclass(frozen=True)
class Member:
    """A column of a group. joint: index of the joint that its name has, or None. number: in its name, or
    None.
    """

    column: Column
    joint: int | None
    number: int | None


@dataclass(frozen=True)
class Group:
    """Columns of one quantity. words: of their names, without joints. quantity: or empty, why says why."""

    stream: str
    words: Words
    unit: str
    quantity: str
    why: str
    members: tuple[Member, ...]

    @property
    def title(self) -> str:
        """Title of the group: the name of its column, or of its first and last."""
        names = [member.column.name for member in self.members]
        return names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"

    def is_named(self, count: int) -> bool:
        """Whether its columns are known by the names of their joints, of so many, and not by their order."""
        named = {member.joint for member in self.members if member.joint is not None}
        return bool(named) and 2 * len(named) >= min(len(self.members), count)

    def by_joint(self, count: int) -> tuple[dict[int, Column], str]:
        """Columns by index of their joint, of so many joints, by name or by order, and why."""
        if self.is_named(count):
            named = {member.joint: member.column for member in self.members if member.joint is not None}
            return named, "by the joints' names"
        numbers = [member.number for member in self.members]
        members = list(self.members)
        foreign = any(member.column.label for member in members)
        reason = (
            "their names are none of the model's: in the file's order" if foreign else "in the file's order"
        )
        if all(number is not None for number in numbers):
            members.sort(key=lambda member: member.number or 0)
            reason = f"numbers {members[0].number} to {members[-1].number} in the joints' order"
        elif len(members) == 1 and count > 1:
            return {}, "one column without a joint"
        if len(members) > count:
            reason += f", the first {count} of {len(members)} columns"
        return {joint: member.column for joint, member in zip(range(count), members, strict=False)}, reason


def groups_of(table: Table, joints: Joints | None) -> list[Group]:
    """All columns but time stamps in groups, in the file's order. joints: or None where nobody names them."""
    names = _Joints(joints.names) if joints is not None else None
    columns = [column for column in table.columns() if column.channel.quantity != "time"]
    zero_based = set() if names is not None and names.have_zero else _numbered_from_zero(columns)
    members: dict[tuple[str, str, Words, Words], list[Member]] = {}
    units: dict[tuple[str, str, Words, Words], str] = {}
    for column in columns:
        head, label = parsed(column.channel.name), parsed(column.label)
        may_be_named = _pattern(head, label) not in zero_based
        joint, number, words = _placed(column, head, label, names if may_be_named else None)
        key = (column.stream.name, column.channel.quantity, *words)
        members.setdefault(key, []).append(Member(column, joint, number))
        units.setdefault(key, column.channel.unit or label.unit or head.unit)
    found = []
    for key, each in members.items():
        stream, quantity, *spoken = key
        whole = (*spoken[0], *spoken[1])
        why = "so the format says"
        if not quantity and set(whole) & ALONE_WORDS and not any(map(_has_place, each)):
            why = "of the robot, not of a joint"
        elif not quantity:
            quantity, why = quantity_of(whole, parsed(stream).words)
        found.append(Group(stream, whole, units[key], quantity, why, tuple(each)))
    return found


def _has_place(member: Member) -> bool:
    return member.joint is not None or member.number is not None


def names_in(table: Table) -> tuple[str, ...]:
    """The joints that the recording itself names, or as many numbered ones as it has positions."""
    groups = groups_of(table, None)
    members = [member.column for group in groups if group.quantity == "position" for member in group.members]
    labels = [column.label for column in members if column.channel is members[0].channel]
    if labels and all(labels):
        return tuple(dict.fromkeys(labels))
    rests: dict[Words, dict[str, None]] = {}
    for group in groups:
        spoken = [
            word for word in group.words if quantity_word([word]) or word in REFERENCE_WORDS | MEASURED_WORDS
        ]
        rest = [word for word in group.words if word not in spoken]
        if quantity_of(spoken)[0] == "position" and rest:
            for member in group.members:
                number = "" if member.number is None else f"_{member.number}"
                rests.setdefault(tuple(spoken), {})["_".join(rest) + number] = None
    if rests:
        names = [tuple(each) for each in rests.values()]
        return max(names, key=len)
    counts = [len(group.members) for group in groups if group.quantity == "position"]
    return tuple(f"joint_{index + 1}" for index in range(max(counts, default=0)))


def _pattern(head: Name, label: Name) -> Words:
    return tuple("#" if word.isdecimal() else word for word in (*head.words, "/", *label.words))


def _numbered_from_zero(columns: Sequence[Column]) -> set[Words]:
    """Patterns of names that differ by a number alone, which starts at zero: no joint's own number."""
    numbers: dict[Words, set[int]] = {}
    for column in columns:
        head, label = parsed(column.channel.name), parsed(column.label)
        found = [int(word) for word in (*head.words, *label.words) if word.isdecimal()]
        if len(found) == 1:
            numbers.setdefault(_pattern(head, label), set()).add(found[0])
    return {pattern for pattern, each in numbers.items() if 0 in each and len(each) > 1}


def _placed(
    column: Column, head: Name, label: Name, names: "_Joints | None"
) -> tuple[int | None, int | None, tuple[Words, Words]]:
    """Joint and number of a column, and the words of its channel and its label without them."""
    if names is not None:
        joint, _, after = names.found_in(label.words)
        if joint is not None:
            # Before a joint's name in a list stands what the list is of.
            return joint, None, (head.words, after)
        joint, before, after = names.found_in(head.words)
        if joint is not None:
            return joint, None, ((*before, *after), label.words)
    if not column.label and column.channel.values.shape[1] > 1:
        return None, _place(column), (head.words, ())
    source = label if column.label else head
    places = [at for at, word in enumerate(source.words) if word.isdecimal()]
    if not places:
        # Labels that are no joint's name still distinguish the columns of one list.
        rest = tuple(word for word in label.words if quantity_word([word])) if column.label else ()
        return None, None, (head.words, rest)
    number = int(source.words[places[-1]])
    rest = (*source.words[: places[-1]], *source.words[places[-1] + 1 :])
    return None, number, ((head.words, rest) if column.label else (rest, ()))


def _place(column: Column) -> int:
    channel: Channel = column.channel
    prefix = column.stream.column_name("")
    return channel.columns().index(column.name.removeprefix(prefix))


class _Joints:
    """Joints' names as sequences of words by which a column's name is known to be of one of them."""

    def __init__(self, names: Sequence[str]):
        words = [parsed(name).words for name in names]
        self.have_zero = any(word == "0" for each in words for word in each)
        spelled: dict[Words, int | None] = {}
        for joint, own in enumerate(words):
            for each in {*(own[at:] for at in range(len(own))), _core(own, words)}:
                # What is of several joints is of none; a number alone is anybody's.
                generic = all(word.isdecimal() or word in GENERIC for word in each)
                if not generic or (len(each) > 1 and each[-1].isdecimal()):
                    spelled[each] = None if each in spelled else joint
        for joint, own in enumerate(words):
            spelled[own] = joint
        self._spelled: Mapping[Words, int | None] = spelled

    def found_in(self, words: Words) -> tuple[int | None, Words, Words]:
        """The joint whose name is in these words at the greatest length, and the words before and after."""
        for length in range(len(words), 0, -1):
            for at in range(len(words) - length + 1):
                joint = self._spelled.get(words[at : at + length])
                if joint is not None:
                    return joint, words[:at], words[at + length :]
        return None, words, ()


def _core(own: Words, words: Sequence[Words]) -> Words:
    """A joint's words without those that all joints begin or end with; at least one is left."""
    if len(words) == 1:
        return own
    first, last = _shared(words), _shared([each[::-1] for each in words])
    return own[min(first, len(own) - 1) :][: max(len(own) - first - last, 1)]


def _shared(words: Sequence[Words]) -> int:
    """How many words all begin with."""
    return sum(1 for _ in takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False)))
