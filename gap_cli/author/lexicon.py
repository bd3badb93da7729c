"""The closed-class words of the instruction grammar: verbs, prepositions, conjunctions, pronouns, politeness."""

from __future__ import annotations

from enum import Enum


class Kind(Enum):
    """What a lexeme is to the grammar."""

    PUT = "a verb that moves something somewhere"
    TAKE = "a verb that picks something up"
    FILL = "a verb that fills a container"
    WANT = "a wish"
    GOES = "a statement of where something belongs"
    IN = "into a container"
    RELATION = "a place that is not inside a container"
    FROM = "where something is now"
    WITH = "with"
    UP = "up"
    THE = "a determiner"
    BOTH = "both"
    IT = "a pronoun for one thing"
    THEM = "a pronoun for several"
    THERE = "a pronoun for a container"
    AND = "a conjunction"
    THEN = "an order word"
    COMMA = "a comma"
    STOP = "the end of a sentence"
    FILLER = "politeness"
    COUNT = "a number"
    ALL = "a quantifier"
    NOT = "a negation"
    OBJECT = "an object of the task"
    SUPPORT = "a surface of the task"
    UNKNOWN = "an unknown word"


_WORDS: dict[Kind, str] = {
    Kind.PUT: "put place move transfer drop set deposit stow store stash insert lay bring carry deliver send shift "
    "relocate position drop_off",
    Kind.TAKE: "pick grab grasp take lift fetch get collect retrieve pick_up",
    Kind.FILL: "pack load fill stock",
    Kind.WANT: "i_want i_need i_would_like i_d_like we_want we_need we_would_like we_d_like",
    Kind.GOES: "goes go belongs belong should_go should_be must_go must_be needs_to_go needs_to_be need_to_go "
    "need_to_be has_to_go has_to_be have_to_go have_to_be to_be to_go",
    Kind.IN: "in into inside inside_of within to in_to",
    Kind.RELATION: "on onto on_top_of atop over above under below beneath beside next_to near behind between "
    "in_front_of left_of right_of to_the_left_of to_the_right_of out out_of outside outside_of around against",
    Kind.FROM: "from off off_of lying_on standing_on sitting_on that_is_on which_is_on",
    Kind.WITH: "with",
    Kind.UP: "up",
    Kind.THE: "the a an my your our his her their this that these those one",
    Kind.BOTH: "both",
    Kind.IT: "it this_one that_one",
    Kind.THEM: "them both_of_them these_two those_two the_two",
    Kind.THERE: "there in_there into_there the_same_one",
    Kind.AND: "and & + plus as_well_as along_with together_with",
    Kind.THEN: "then next finally lastly afterwards afterward after_that followed_by first firstly second secondly "
    "third thirdly also too as_well start_with begin_with",
    Kind.FILLER: "please kindly thanks thank_you for_me now robot hey hello hi ok okay can_you could_you would_you "
    "will_you can_you_please could_you_please would_you_please i_want_you_to i_need_you_to i_would_like_you_to "
    "i_d_like_you_to you_should you_must your_task_is_to the_task_is_to go_ahead_and let_us let_s help_me "
    "carefully safely",
    Kind.COUNT: "two three four five six seven eight nine ten dozen twice several many few couple half",
    Kind.ALL: "all every each everything anything any something some rest others other remaining",
    Kind.NOT: "not no never don_t dont do_not except without but avoid unless if when until instead nothing neither "
    "nor",
}

PHRASES: dict[tuple[str, ...], Kind] = {
    tuple(phrase.split("_")): kind for kind, phrases in _WORDS.items() for phrase in phrases.split()
}
MARKS: dict[str, Kind] = {
    ",": Kind.COMMA,
    ";": Kind.STOP,
    ".": Kind.STOP,
    "!": Kind.STOP,
    "?": Kind.STOP,
    ":": Kind.COMMA,
}
