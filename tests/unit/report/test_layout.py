from gap_cli.report.layout import back_links, layers


def test_a_chain_is_a_column():
    assert layers("abc", [("a", "b"), ("b", "c")]) == [["a"], ["b"], ["c"]]


def test_a_join_waits_below_its_longest_branch():
    links = [("a", "b"), ("a", "c"), ("b", "d"), ("d", "e"), ("c", "e")]
    assert layers("abcde", links) == [["a"], ["b", "c"], ["d"], ["e"]]


def test_loops_end_and_lead_back():
    links = [("a", "b"), ("b", "c"), ("c", "b"), ("c", "d")]
    assert back_links("abcd", links) == {("c", "b")}
    assert layers("abcd", links) == [["a"], ["b"], ["c"], ["d"]]


def test_a_node_may_lead_to_itself():
    assert back_links("a", [("a", "a")]) == {("a", "a")}
    assert layers("a", [("a", "a")]) == [["a"]]


def test_branches_do_not_cross_without_need():
    links = [("a", "l"), ("a", "r"), ("r", "y"), ("l", "x")]
    assert layers("alryx", links)[2] == ["x", "y"]
