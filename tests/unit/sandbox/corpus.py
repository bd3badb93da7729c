"""Things untrusted code tries. CANARY is a path it must not create; PORT a listening socket it must not reach.

`ends` are the causes it may end with; `value` means it returns something harmless. `fires` marks payloads that do reach
the canary (or the socket) where the system-call filter is off: they show that it is the filter which holds.
"""

from typing import NamedTuple


class Payload(NamedTuple):
    name: str
    code: str
    ends: str
    fires: bool = False


LIBC = "import ctypes\nlibc = ctypes.CDLL(None)\n"
TRAVERSE = (
    "[c for c in ().__class__.__mro__[1].__subclasses__() if c.__name__ == '_wrap_close'][0].__init__.__globals__"
)
FRAME = "try:\n    1 / 0\nexcept ZeroDivisionError as e:\n    f = e.__traceback__.tb_frame\n"

FILES = [
    Payload("open for writing", "open(CANARY, 'w')", "syscall", True),
    Payload("open for reading", "open('/etc/passwd').read()", "syscall"),
    Payload("os.open", "import os\nos.open(CANARY, os.O_CREAT | os.O_WRONLY, 0o666)", "syscall", True),
    Payload("mkdir", "import os\nos.mkdir(CANARY)", "syscall", True),
    Payload("symlink", "import os\nos.symlink('/etc/passwd', CANARY)", "syscall", True),
    Payload("mkfifo", "import os\nos.mkfifo(CANARY)", "syscall", True),
    Payload("chmod", "import os\nos.chmod('/tmp', 0o777)", "syscall"),
    Payload("utime", "import os\nos.utime('/tmp')", "syscall"),
    Payload("chown", "import os\nos.chown('/tmp', 1, 1)", "syscall"),
    Payload("setxattr", "import os\nos.setxattr('/tmp', 'user.x', b'1')", "syscall"),
    Payload("unlink", "import os\nos.unlink(CANARY)", "syscall"),
    Payload("rename", "import os\nos.rename('/tmp', CANARY)", "syscall"),
    Payload("listdir", "import os\nos.listdir('/')", "syscall"),
    Payload("chdir", "import os\nos.chdir('/')", "syscall"),
    Payload("stat", "import os\nos.stat('/etc/shadow')", "syscall"),
    Payload("truncate", "import os\nos.truncate('/etc/hostname', 0)", "syscall"),
    Payload("memfd", "import os\nos.memfd_create('x')", "syscall"),
    Payload("io.FileIO", "import io\nio.FileIO(CANARY, 'w')", "syscall", True),
    Payload("codecs.open", "import codecs\ncodecs.open(CANARY, 'w')", "syscall", True),
    Payload("lazy import", "import antigravity", "forbidden"),
    Payload("import a path", "import sys\nsys.path.insert(0, '/tmp')\nimport payload_module", "forbidden"),
    Payload("loader reads", "import vos, sys\nsys.modules['os'].__loader__.get_data('/etc/passwd')", "syscall error"),
    Payload("linecache", "import linecache\nassert not linecache.getlines('/etc/passwd')", "value"),
    Payload("relative open", "open('x', 'w')", "syscall"),
    Payload("own memory", "open('/proc/self/mem', 'rb')", "syscall"),
    Payload("parent's memory", "import os\nopen(f'/proc/{os.getpid() - 1}/mem', 'rb')", "syscall"),
]
PROCESSES = [
    Payload("fork", "import os\nos.fork()", "syscall"),
    Payload("execv", "import os\nos.execv('/bin/sh', ['sh', '-c', ': > ' + CANARY])", "syscall"),
    Payload("system", "import os\nos.system('touch ' + CANARY)", "syscall"),
    Payload("popen", "import os\nos.popen('touch ' + CANARY)", "syscall forbidden error"),
    Payload("posix_spawn", "import os\nos.posix_spawn('/bin/touch', ['touch', CANARY], {})", "syscall"),
    Payload("thread", "import threading\nthreading.Thread(target=print).start()", "syscall"),
    Payload("low-level thread", "import _thread\n_thread.start_new_thread(print, ())", "syscall"),
    Payload("kill the parent", "import os\nos.kill(os.getppid(), 9)", "syscall"),
    Payload("kill everyone", "import os\nos.kill(-1, 9)", "syscall"),
    Payload("killpg", "import os\nos.killpg(1, 9)", "syscall"),
    Payload("raise_signal", "import signal\nsignal.raise_signal(9)", "syscall"),
    Payload("deaf to signals", "import signal\nsignal.signal(signal.SIGXCPU, signal.SIG_IGN)", "syscall"),
    Payload("setsid", "import os\nos.setsid()", "syscall"),
    Payload("setuid root", "import os\nos.setuid(0)", "syscall"),
    Payload("raise limits", "import resource as r\nr.setrlimit(r.RLIMIT_AS, (-1, -1))", "syscall"),
    Payload("abort", "import os\nos.abort()", "syscall crash"),
    Payload("exit at once", "import os\nos._exit(0)", "crash"),
    Payload("SystemExit", "raise SystemExit(0)", "error"),
    Payload("KeyboardInterrupt", "raise KeyboardInterrupt", "error"),
    Payload("close the pipes", "import os\nos.closerange(0, 100)\nwhile True: pass", "syscall crash"),
    Payload("close one by one", "import os\n[os.close(i) for i in (0, 1, 2, 3, 4)]\nwhile True: pass", "crash"),
]
SOCKETS = [
    Payload("tcp connect", "import _socket as s\ns.socket().connect(('127.0.0.1', PORT))", "syscall", True),
    Payload("unix bind", "import _socket as s\ns.socket(s.AF_UNIX).bind(CANARY)", "syscall", True),
    Payload(
        "udp", "import _socket as s\ns.socket(s.AF_INET, s.SOCK_DGRAM).sendto(b'x', ('127.0.0.1', PORT))", "syscall"
    ),
    Payload("pipe", "import os\nos.pipe()", "syscall"),
    Payload("inherited descriptors", "import os\n[os.write(i, b'x') for i in range(5, 16)]", "syscall error"),
]
KERNEL = [
    Payload(f"raw {name}", LIBC + f"libc.syscall({number}, 0, 0, 0, 0, 0, 0)", "syscall")
    for name, number in [
        ("socket", 41), ("clone", 56), ("fork", 57), ("execve", 59), ("ptrace", 101), ("prctl", 157), ("mount", 165),
        ("reboot", 169), ("unshare", 272), ("process_vm_readv", 310), ("seccomp", 317), ("memfd_create", 319),
        ("bpf", 321), ("userfaultfd", 323), ("io_uring_setup", 425), ("clone3", 435), ("pidfd_open", 434),
        ("setns", 308), ("perf_event_open", 298), ("keyctl", 250), ("x32 write", 0x40000001), ("unknown", 9999),
    ]
] + [
    Payload("executable memory", LIBC + "libc.mmap(0, 4096, 7, 0x22, -1, 0)", "syscall"),
    Payload("make it executable", LIBC + "libc.mprotect(id(libc) & ~4095, 4096, 7)", "syscall"),
    Payload("null pointer", LIBC + "ctypes.string_at(0)", "crash"),
    Payload("free garbage", LIBC + "libc.free(ctypes.c_void_p(12345))", "crash syscall"),
]  # fmt: skip
LANGUAGE = [
    Payload("subclasses to os", TRAVERSE + "['system']('touch ' + CANARY)", "syscall"),
    Payload("subclasses to open", TRAVERSE + "['__builtins__']['open'](CANARY, 'w')", "syscall", True),
    Payload("mro through a string", "type('').__mro__[-1].__subclasses__()", "value"),
    Payload("frame globals", FRAME + "f.f_back.f_globals['__builtins__']['open'](CANARY, 'w')", "syscall", True),
    Payload("generator frame", "g = (x for x in [1])\ng.gi_frame.f_builtins['open'](CANARY, 'w')", "syscall", True),
    Payload("format string", "assert '{0.__class__.__init__.__globals__}'.format(print.__self__)", "value error"),
    Payload("format a class", "class C: pass\n'{0.__init__.__globals__}'.format(C())", "value error"),
    Payload("AttributeError.obj", "try: ().x\nexcept AttributeError as e: e.obj.__class__.__mro__", "value"),
    Payload("match on a class", "match 1:\n    case object(__class__=c): c.__mro__", "value"),
    Payload("reduce", "print.__reduce_ex__(4)", "value error"),
    Payload("augmented attribute", "def f(): pass\nf.__globals__ |= {'x': 1}", "value error"),
    Payload(
        "replace code", "def f(): pass\nf.__code__ = f.__code__.replace(co_code=b'\\xff' * 8)\nf()", "crash error value"
    ),
    Payload(
        "bytecode out of range",
        "def f(): return 1\nf.__code__ = f.__code__.replace(co_consts=())\nf()",
        "crash error value",
    ),
    Payload("exec", "exec('import os; os.mkdir(CANARY)', {'CANARY': CANARY})", "syscall", True),
    Payload("builtins through import", "__import__('os').mkdir(CANARY)", "syscall", True),
    Payload("importlib", "import importlib\nimportlib.import_module('os').mkdir(CANARY)", "syscall", True),
    Payload("decorator calls", "import os\n@os.mkdir\ndef x(): pass", "error"),
    Payload(
        "metaclass",
        "class M(type):\n    def __new__(m, *a):\n        import os; os.mkdir(CANARY)\nclass C(metaclass=M): pass",
        "syscall",
        True,
    ),
    Payload("destructor", "class C:\n    def __del__(self):\n        open(CANARY, 'w')\nC()", "value", True),
    Payload("exit handler", "import atexit, os\natexit.register(os.mkdir, CANARY)", "value"),
    Payload("audit hook", "import sys\nsys.addaudithook(print)", "value"),
    Payload("trace", "import sys\nsys.settrace(lambda *a: None)", "value"),
    Payload("message that lies", "class E(Exception):\n    def __str__(self): raise SystemExit\nraise E", "error"),
    Payload("message in colour", "raise ValueError('\\x1b[2J\\u202e' + '\\ud800')", "error"),
]
BOMBS = [
    Payload("memory at once", "x = bytearray(10 ** 11)", "memory"),
    Payload("memory bit by bit", "x = []\nwhile True: x.append(bytearray(10 ** 6))", "memory"),
    Payload("many small objects", "x = []\nwhile True: x.append([x])", "memory timeout crash"),
    Payload("string doubling", "x = 'x'\nwhile True: x += x", "memory"),
    Payload(
        "memory in the handler",
        "try:\n    x = bytearray(10**11)\nexcept MemoryError:\n    while True: x = [bytearray(10**6)]*10**9",
        "memory",
    ),
    Payload("endless loop", "while True: pass", "timeout"),
    Payload(
        "loop that swallows",
        "while True:\n    try:\n        while True: pass\n    except BaseException: pass",
        "timeout",
    ),
    Payload("big power", "9 ** 9 ** 8", "timeout memory"),
    Payload("big decimal", "str(7 ** 10 ** 7)", "timeout error"),
    Payload("regular expression", "import re\nre.match('(a+)+$', 'a' * 60 + 'b')", "timeout"),
    Payload("sleep", "import time\ntime.sleep(600)", "timeout"),
    Payload("sum of a range", "sum(range(10 ** 18))", "timeout"),
    Payload("sort", "sorted(range(10 ** 9))", "timeout memory"),
    Payload("recursion", "def f(): f()\nf()", "error"),
    Payload("deep recursion", "import sys\nsys.setrecursionlimit(10 ** 9)\ndef f(): f()\nf()", "memory crash timeout"),
    Payload(
        "deep repr",
        "import sys\nsys.setrecursionlimit(10 ** 9)\nx = []\nfor i in range(10 ** 6): x = [x]\nrepr(x)",
        "crash timeout",
    ),
    Payload("deep list freed", "x = []\nfor i in range(10 ** 6): x = [x]\ndel x", "value"),
    Payload("descriptors", "import os\nwhile True: os.dup(0)", "syscall"),
    Payload("deadlock", "import _thread\nl = _thread.allocate_lock()\nl.acquire()\nl.acquire()", "timeout"),
    Payload("deep source", "(" * 5000, "error"),
    Payload("deep expression", "x = " + "-" * 150_000 + "1", "error memory crash forbidden"),
    Payload("long chain", "x = 1" + " + 1" * 20_000, "error memory crash value forbidden"),
]
BUILDER_OUTPUT = [
    Payload("too much", "Subgraph.to_dict = lambda self: {'x': 'x' * 10 ** 7}", "output"),
    Payload("not a number", "Subgraph.to_dict = lambda self: {'x': float('nan')}", "output"),
    Payload("overflow in JSON", "import os, struct\ns = b'{\"result\":{\"x\":1e999}}'\nos.write(4, struct.pack('<I', len(s)) + s)", "output"),
    Payload("nested deep", "x = []\nfor i in range(10 ** 4): x = [x]\nSubgraph.to_dict = lambda self: {'x': x}", "output"),
    Payload("nested somewhat", "x = []\nfor i in range(200): x = [x]\nSubgraph.to_dict = lambda self: {'x': x}", "output"),
    Payload("half a character", "Subgraph.to_dict = lambda self: {'x': '\\ud800'}", "output"),
    Payload("huge integer", "Subgraph.to_dict = lambda self: {'x': 10 ** 400}", "output"),
    Payload("an object", "Subgraph.to_dict = lambda self: {'x': object()}", "output"),
    Payload("not a graph", "Subgraph.to_dict = lambda self: [1]", "output"),
    Payload("forged length", "import os\nos.write(4, b'\\xff' * 64)", "output"),
    Payload("forged garbage", "import os\nos.write(4, b'\\x04\\0\\0\\0\\xc3\\x28{}')", "output"),
    Payload("forged depth", "import os, struct\ns = b'[' * 10 ** 6\nos.write(4, struct.pack('<I', len(s)) + s)", "output"),
    Payload("forged twice", "import os, struct\ns = b'{\"result\":{\"a\":1,\"a\":2}}'\nos.write(4, struct.pack('<I', len(s)) + s)", "output"),
    Payload("forged error", "import os, struct\ns = b'{\"error\":{\"cause\":[],\"line\":1e9,\"message\":{}}}'\nos.write(4, struct.pack('<I', len(s)) + s)", "error"),
    Payload("flood", "import os\nwhile True: os.write(4, b'\\xff' * 10 ** 6)", "output"),
    Payload("slow drip", "import os, time\nos.write(4, b'\\x10\\0\\0\\0')\nwhile True:\n    time.sleep(.01); os.write(4, b' ')", "timeout output"),
    Payload("pickle instead", "import os, struct\ns = b'\\x80\\x04cos\\nsystem\\n(S\"touch x\"\\ntR.'\nos.write(4, struct.pack('<I', len(s)) + s)", "output"),
]  # fmt: skip
NUMPY = [
    Payload("runstring", "np.testing.runstring('open(CANARY, \"w\")', {'CANARY': CANARY})", "forbidden syscall error"),
    Payload("ctypeslib", "import numpy.ctypeslib\nnumpy.ctypeslib.load_library('libc.so.6', '/lib')", "syscall error forbidden"),
    Payload("save", "np.save(CANARY, np.eye(3))", "syscall", True),
    Payload("savez", "np.savez(CANARY, a=np.eye(3))", "syscall forbidden"),
    Payload("savetxt", "np.savetxt(CANARY, np.eye(3))", "syscall", True),
    Payload("tofile", "np.eye(3).tofile(CANARY)", "syscall", True),
    Payload("dump", "np.eye(3).dump(CANARY)", "syscall", True),
    Payload("memmap", "np.memmap(CANARY, dtype='u1', mode='w+', shape=(1,))", "syscall forbidden"),
    Payload("load", "np.load('/etc/passwd', allow_pickle=True)", "syscall"),
    Payload("loadtxt", "np.loadtxt('/etc/passwd', dtype=str)", "syscall error"),
    Payload("genfromtxt", "np.genfromtxt('/etc/passwd', dtype=str)", "syscall error"),
    Payload("fromfile", "np.fromfile('/etc/passwd', 'u1')", "syscall"),
    Payload("DataSource", "np.lib.npyio.DataSource('/tmp').open('http://127.0.0.1:PORT/x')", "syscall error forbidden"),
    Payload("pickle in an array", "import pickle\npickle.loads(b'cposix\\nmkdir\\n(V' + CANARY.encode() + b'\\ntR.')", "syscall", True),
    Payload("as_strided read", "np.lib.stride_tricks.as_strided(np.zeros(1), (10 ** 12,), (8,))[10 ** 11]", "crash"),
    Payload("as_strided write", "a = np.lib.stride_tricks.as_strided(np.zeros(1), (10 ** 12,), (8,))\na[10 ** 10] = 1", "crash"),
    Payload("array interface", "class A: __array_interface__ = {'shape': (1,), 'typestr': '<i8', 'data': (1, False), 'version': 3}\nnp.asarray(A())[0]", "crash"),
    Payload("f2py", "import numpy.f2py\nnumpy.f2py.compile('x')", "forbidden syscall error"),
    Payload("entropy", "np.random.default_rng().normal()", "syscall"),
    Payload("big array", "np.ones((10 ** 6, 10 ** 6))", "memory"),
    Payload("big array touched", "x = []\nwhile True: x.append(np.ones(10 ** 7))", "memory timeout"),
    Payload("big SVD", "np.linalg.svd(np.ones((3000, 3000)))", "timeout"),
    Payload("einsum", "np.einsum('i,j,k,l->', *[np.ones(2000)] * 4)", "timeout"),
    Payload("object array", "np.array([print], dtype=object)[0]", "value"),
]  # fmt: skip
RPC = [
    Payload("unknown tool", "ctx.tool('no.Such')", "UnknownNameError"),
    Payload("a file as a tool", "ctx.tool('../../etc/passwd')", "UnknownNameError"),
    Payload("endless calls", "while True: ctx.tool('a.Echo', x=1)", "forbidden timeout"),
    Payload("huge argument", "ctx.tool('a.Echo', x=np.ones(10 ** 7))", "output"),
    Payload("many items", "send([[[]] * 60000] * 40)", "output"),
    Payload("not finite", "ctx.tool('a.Echo', x=float('nan'))", "output"),
    Payload("an object", "ctx.tool('a.Echo', x=object())", "error ToolError BadRequestError"),
    Payload("publishes", "ctx.publish(1)", "forbidden"),
    Payload("returns too much", "return np.ones(10 ** 7)", "output"),
    Payload("returns itself", "x = []\nx.append(x)\nreturn x", "error BadRequestError"),
    Payload("forged type", "send({'$type': 'Quaternion', 'w': 0, 'x': 0, 'y': 0, 'z': 0})", "output"),
    Payload("forged class", "send({'$type': '__class__'})", "output"),
    Payload("forged record", "send({'$record': {'__class__': 1}})", "output value"),
    Payload("forged array", "send(ext(1, b'\\x0a\\x92\\xa3|O8\\x91\\x01' + b'\\0' * 16))", "output"),
    Payload("forged shape", "send(ext(1, b'\\x0e\\x92\\xa3<f8\\x91\\xcf' + b'\\x7f' * 8))", "output"),
    Payload("forged kind", "raw(b'\\x92\\xa4boom\\x01')", "output"),
    Payload("forged list", "raw(b'\\xdd\\xff\\xff\\xff\\xff')", "output"),
    Payload("forged nest", "raw(b'\\x91' * 10 ** 6)", "output"),
    Payload("forged origin", "raw(msgpack.packb(['error', {'origin': 10 ** 9, 'kind': 'SystemExit', 'line': True}]))", "error"),
    Payload("forged length", "os.write(4, b'\\xff' * 4)", "output"),
    Payload("sixty megabytes of nothing", "raw(b'\\x90' * 60_000_000)", "output"),
    Payload("sixty megabytes of lists", "raw(b'\\xdd\\x00\\x00\\xff\\xff' + b'\\x90' * 59_000_000)", "output"),
]  # fmt: skip
