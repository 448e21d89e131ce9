// The command loses nothing: no output is an input or another output, foreign files stay, what can be known is said
// before the work, and nothing but an error of its own is called one.
#include "tests/cli/command.hpp"

#include <nlohmann/json.hpp>

#include <cstddef>
#include <set>

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>

namespace prolate {
namespace {

using Json = nlohmann::json;
using Words = std::vector<std::string>;

Words operator+(Words a, const Words& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

class CliOutputs : public Cli {
protected:
    // A tree and its mesh of this test's own, and what bakes the mesh soon.
    std::string tree() const { return file("t.etree", read(shared("peanut.etree"))); }
    std::string mesh() const { return file("m.obj", obj_text(cube())); }
    static Words bake(const std::string& mesh) { return {"bake", mesh, "--ellipsoids", "1", "--quality", "fast"}; }
    // Every command that writes a file, by the kind of the file, without "-o FILE".
    struct Writer {
        std::string kind;
        Words words;
    };
    std::vector<Writer> writers(const std::string& tree, const std::string& mesh) const {
        std::vector<Writer> out{{"etree", bake(mesh)},
                                {"png", {"render", tree, mesh, "--size", "400x300", "--samples", "16"}},
                                {"html", {"view", tree}}};
        for (const char* format : {"csv", "json", "ply", "obj", "glb", "pov"})
            out.push_back({format, {"export", tree, "--format", format, "--level", "1"}});
        return out;
    }
    // The run fails with this code and these words, and every file is as it was.
    void expect_refused(const Words& words, int code, const std::string& says) {
        const auto before = contents();
        const Outcome o = run(words);
        EXPECT_EQ(o.code, code) << o.err;
        EXPECT_NE(o.err.find(says), std::string::npos) << o.err;
        EXPECT_TRUE(contents() == before) << "something was written";
    }
    std::vector<std::pair<std::string, std::string>> contents() const {
        std::vector<std::pair<std::string, std::string>> out;
        for (const std::string& name : listing())
            out.emplace_back(name, fs::is_regular_file(folder_ / name) ? read(folder_ / name) : "");
        return out;
    }
};

// ---- no output is an input, none is foreign ----

TEST_F(CliOutputs, NoOutputIsAnInputWhateverItIsCalled) {
    const std::string t = tree(), m = mesh(), name = folder_.filename();
    fs::create_symlink("t.etree", folder_ / "soft-t");
    fs::create_hard_link(t, folder_ / "hard-t");
    fs::create_symlink("m.obj", folder_ / "soft-m");
    fs::create_hard_link(m, folder_ / "hard-m");
    fs::create_directory_symlink(".", folder_ / "here");
    for (const Writer& writer : writers(t, m)) {
        const bool is_bake = writer.words[0] == "bake";
        for (const std::string& input : is_bake ? Words{"m.obj"} : Words{"t.etree"})
            for (const std::string& alias :
                 {input, "./" + input, "../" + name + "/" + input, "here/" + input,
                  std::string(is_bake ? "soft-m" : "soft-t"), std::string(is_bake ? "hard-m" : "hard-t")})
                for (const Words& force : {Words{}, Words{"--force"}}) {
                    // Two commands also look at the ending of the name.
                    if ((writer.kind == "png" || writer.kind == "html") && fs::path(alias).has_extension()) continue;
                    SCOPED_TRACE(writer.words[0] + " " + writer.kind + " -o " + alias);
                    expect_refused(writer.words + Words{"-o", file(alias)} + force, 2,
                                   is_bake ? "the mesh" : "the tree");
                }
    }
    expect_refused(Words{"render", t, m, "-o", file("hard-m"), "--force"}, 2, "the mesh");
    expect_refused(Words{"view", t, m, "-o", file("soft-m"), "--force"}, 2, "the mesh");
    expect_refused(Words{"export", t, "-o", file("here/here/t.etree"), "--format", "csv"}, 2, "the tree");
}

TEST_F(CliOutputs, FilesThatAMeshIsReadFromAreInputs) {
    // A tetrahedron whose numbers lie in two files; the name of one is escaped.
    const float points[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const uint16_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    const std::string binary = file("the points.bin", {reinterpret_cast<const char*>(points), sizeof points});
    file("corners.bin", {reinterpret_cast<const char*>(corners), sizeof corners});
    const std::string m = file("m.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 1, "byteLength": 24}],
        "buffers": [{"uri": "the%20points.bin", "byteLength": 48}, {"uri": "corners.bin", "byteLength": 24}]})");
    fs::create_hard_link(binary, folder_ / "hard");
    for (const char* name : {"the points.bin", "corners.bin", "hard"})
        expect_refused(bake(m) + Words{"-o", file(name), "--force"}, 2, "read with the mesh");
    expect_refused(Words{"render", tree(), m, "-o", file("hard"), "--force"}, 2, "read with the mesh");
    const std::string manifest =
        file("assets.json", R"({"assets": [{"mesh": "m.obj", "output": "corners.bin", "ellipsoids": 1},
                                           {"mesh": "m.gltf", "output": "a.etree", "ellipsoids": 1}]})");
    mesh();
    const Outcome o = run({"bake", "--manifest", manifest, "--json", "--force"});
    EXPECT_EQ(Json::parse(o.out)["failed"], 1) << o.err;
    EXPECT_NE(o.err.find("read with the mesh of asset 2"), std::string::npos) << o.err;
    EXPECT_EQ(run({"info", file("a.etree")}).code, 0);
}

TEST_F(CliOutputs, NoOutputIsAnotherOutput) {
    const std::string m = mesh();
    fs::create_symlink("a.etree", folder_ / "dangling");
    for (const char* report : {"a.etree", "./a.etree", "dangling"})
        expect_refused(bake(m) + Words{"-o", file("a.etree"), "--report", file(report)}, 2, "the output");
    expect_refused(bake(m) + Words{"-o", file("a.etree"), "--report", file("./m.obj"), "--force"}, 2, "the mesh");
    expect_refused(bake(m) + Words{"-o", file("a.etree"), "--cache", file("a.etree")}, 2, "the cache folder");
    expect_refused(bake(m) + Words{"-o", "-", "--report", "/dev/stdout"}, 2, "the output");
    EXPECT_EQ(run(bake(m) + Words{"-o", "/dev/null", "--report", "/dev/null"}).code, 0) << "a device may be both";

    const std::string manifest = file("assets.json", R"({"defaults": {"ellipsoids": 1, "quality": "fast"}, "assets": [
        {"mesh": "m.obj", "output": "a2.etree"},
        {"mesh": "m.obj", "output": "./a2.etree"},
        {"mesh": "m.obj", "output": "b.etree", "report": "dangling"},
        {"mesh": "m.obj", "output": "a.etree"},
        {"mesh": "m.obj", "output": "c.etree", "report": "./assets.json"}]})");
    const Outcome o = run({"bake", "--manifest", manifest, "--json", "--force"});
    EXPECT_EQ(o.code, 1);
    const Json summary = Json::parse(o.out);
    EXPECT_EQ(summary["baked"], 2);
    EXPECT_NE(summary["assets"][1]["error"].get<std::string>().find("the output of asset 1"), std::string::npos);
    EXPECT_NE(summary["assets"][3]["error"].get<std::string>().find("the report of asset 3"), std::string::npos);
    EXPECT_NE(summary["assets"][4]["error"].get<std::string>().find("the manifest"), std::string::npos);
    EXPECT_TRUE(read(manifest).starts_with("{\"defaults\""));
    expect_refused({"bake", "--manifest", manifest, "--report", manifest, "--force"}, 2, "the manifest");
    expect_refused({"bake", "--manifest", manifest, "--report", file("m.obj"), "--force"}, 2, "the mesh of asset 1");
}

TEST_F(CliOutputs, RedirectedStandardOutputCountsToo) {
    const std::string t = tree();
    RunOptions into_the_tree;
    into_the_tree.in_child = [&t] { // as "export - -o - <t >>t" would
        ::dup2(::open(t.c_str(), O_WRONLY | O_APPEND), 1);
    };
    EXPECT_EQ(run({"export", t, "-o", "-", "--format", "csv"}, into_the_tree).code, 2);
    EXPECT_EQ(read(t), read(shared("peanut.etree")));
}

TEST_F(CliOutputs, ForeignFilesAreReplacedOnlyByForce) {
    const std::string t = tree(), m = mesh();
    const std::string foreign = "v 0 0 0\nsomebody's work\n";
    for (const Writer& writer : writers(t, m)) {
        SCOPED_TRACE(writer.words[0] + " " + writer.kind);
        const std::string out = file("out." + writer.kind, foreign);
        expect_refused(writer.words + Words{"-o", out}, 4, "--force");
        ASSERT_EQ(run(writer.words + Words{"-o", out, "--force"}).code, 0);
        EXPECT_NE(read(out), foreign);
        EXPECT_EQ(run(writer.words + Words{"-o", out}).code, 0) << "its own it knows by their content";
        write(out, "");
        EXPECT_EQ(run(writer.words + Words{"-o", out}).code, 0) << "in an empty file nothing is lost";
        // A file of prolate's, but another kind: a tree is worth more than a picture.
        if (writer.kind == "png" || writer.kind == "html") continue;
        write(out, read(shared(writer.kind == "etree" ? "report.json" : "peanut.etree")));
        expect_refused(writer.words + Words{"-o", out}, 4, "--force");
    }
    write(folder_ / "report.json", "{\"mine\": 1}");
    fs::remove(file("out.etree"));
    expect_refused(bake(m) + Words{"-o", file("out.etree"), "--report", file("report.json")}, 4, "--force");
    EXPECT_EQ(run(bake(m) + Words{"-o", file("out.etree"), "--report", file("report.json"), "--force"}).code, 0);
    EXPECT_EQ(run(bake(m) + Words{"-o", file("out.etree"), "--report", file("report.json")}).code, 0);

    write(folder_ / "theirs.etree", foreign);
    const std::string manifest = file("assets.json", R"({"assets": [
        {"mesh": "m.obj", "output": "theirs.etree", "ellipsoids": 1, "quality": "fast"}]})");
    expect_refused({"bake", "--manifest", manifest}, 1, "--force");
    EXPECT_EQ(run({"bake", "--manifest", manifest, "--force"}).code, 0);
    EXPECT_NE(read(file("theirs.etree")), foreign);
}

TEST_F(CliOutputs, ACacheEntryThatIsALinkLeadsNowhere) {
    const std::string m = mesh(), cache = file("cache");
    ASSERT_EQ(run(bake(m) + Words{"-o", file("a.etree"), "--cache", cache}).code, 0);
    const std::string theirs = file("theirs", "precious");
    for (const auto& entry : fs::directory_iterator(cache)) {
        fs::remove(entry.path());
        fs::create_symlink(theirs, entry.path());
    }
    EXPECT_EQ(run(bake(m) + Words{"-o", file("b.etree"), "--cache", cache}).code, 0);
    EXPECT_EQ(read(theirs), "precious");
    EXPECT_EQ(read(file("a.etree")), read(file("b.etree")));
}

// ---- outputs first ----

TEST_F(CliOutputs, WhatStandsInTheWayIsSaidBeforeTheInputIsRead) {
    const std::string missing_tree = file("none.etree"), missing_mesh = file("none.obj");
    fs::create_directory(folder_ / "folder");
    const std::string too_long(256, 'n');
    const struct {
        std::string out, says;
    } cases[] = {{file("nowhere/out"), "does not exist"},
                 {file("folder"), "irectory"},
                 {file(too_long), "too long"},
                 {file("none.obj/out"), "does not exist"}};
    for (const Writer& writer : writers(missing_tree, missing_mesh))
        for (const auto& c : cases) {
            SCOPED_TRACE(writer.words[0] + " " + writer.kind + " -o " + c.out);
            expect_refused(writer.words + Words{"-o", c.out}, 4, c.says);
        }
    // Longer than what used to fit with the ending of the temporary name.
    const std::string m = mesh(), longest = file(std::string(249, 'l') + ".etree");
    EXPECT_EQ(run(bake(m) + Words{"-o", longest}).code, 0);
    EXPECT_TRUE(fs::exists(longest));
}

TEST_F(CliOutputs, FoldersOfOthersAreToldBeforeTheWork) {
    const std::string t = tree(), m = mesh();
    fs::permissions(shared_, fs::perms::all);
    fs::permissions(folder_, fs::perms::all);
    fs::create_directory(folder_ / "locked");
    fs::permissions(folder_ / "locked",
                    fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read | fs::perms::others_exec);
    fs::create_directory(folder_ / "sticky");
    fs::permissions(folder_ / "sticky", fs::perms::all | fs::perms::sticky_bit);
    write(folder_ / "sticky/theirs.png", "");
    RunOptions as_nobody;
    as_nobody.in_child = [] { // root may write anywhere, and gives that up
        if (::geteuid() == 0 && (::setgid(65534) != 0 || ::setuid(65534) != 0)) ::_exit(126);
    };
    const Outcome reachable = run({"--version"}, as_nobody);
    if (reachable.code != 0) GTEST_SKIP() << "another user cannot run the command at its place";
    const Words render{"render", t, m, "--size", "400x300", "--samples", "16"};
    const Outcome locked = run(render + Words{"-o", file("locked/a.png")}, as_nobody);
    EXPECT_EQ(locked.code, 4) << locked.err;
    EXPECT_NE(locked.err.find("Permission denied"), std::string::npos) << locked.err;
    if (::geteuid() != 0) GTEST_SKIP() << "only root can make a file of another user's";
    const Outcome sticky = run(render + Words{"-o", file("sticky/theirs.png")}, as_nobody);
    EXPECT_EQ(sticky.code, 4) << sticky.err;
    EXPECT_NE(sticky.err.find("another user's file"), std::string::npos) << sticky.err;
}

// What makes a system call fail with `error`: seccomp, which binds root, too.
std::function<void()> refusing(std::vector<uint32_t> calls, uint32_t error) {
    return [calls = std::move(calls), error] {
        std::vector<sock_filter> filter{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
        for (const uint32_t call : calls) {
            filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1));
            filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | error));
        }
        filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
        const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
        if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
            ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0)
            ::_exit(126);
    };
}

TEST_F(CliOutputs, ARefusedModeIsNoReasonToLoseAFile) {
    RunOptions refused;
    refused.in_child = refusing({SYS_fchmod}, EPERM);
    const Outcome o = run(bake(mesh()) + Words{"-o", file("a.etree")}, refused);
    if (o.code == 126) GTEST_SKIP() << "no seccomp here";
    EXPECT_EQ(o.code, 0) << o.err;
    EXPECT_EQ(run({"info", file("a.etree")}).code, 0);
}

TEST_F(CliOutputs, WhatCannotBeWrittenInTheEndIsKept) {
    const std::string m = mesh();
    fs::create_directory(folder_ / "tmp");
    const std::string kept_in = file("tmp");
    RunOptions refused;
    refused.in_child = [&kept_in] { ::setenv("TMPDIR", kept_in.c_str(), 1); };
    const Outcome o = run(bake(m) + Words{"-o", "/dev/full"}, refused);
    EXPECT_EQ(o.code, 4) << o.err;
    EXPECT_NE(o.err.find("; what was made is kept as " + kept_in), std::string::npos) << o.err;
    const Outcome as_json = run(bake(m) + Words{"-o", "/dev/full", "--json", "--quiet"}, refused);
    EXPECT_EQ(std::count(as_json.err.begin(), as_json.err.end(), '\n'), 1) << as_json.err;
    EXPECT_NE(Json::parse(as_json.out)["error"]["advice"].get<std::string>().find(kept_in), std::string::npos);
    ASSERT_EQ(run(bake(m) + Words{"-o", file("a.etree")}).code, 0);
    EXPECT_EQ(read(file("tmp/kept-1-full")), read(file("a.etree")));
    // A cache has it anyway.
    const Outcome cached = run(bake(m) + Words{"-o", "/dev/full", "--cache", file("cache")}, refused);
    EXPECT_EQ(cached.code, 4);
    EXPECT_NE(cached.err.find("the cache has the tree"), std::string::npos) << cached.err;
    EXPECT_NE(run(bake(m) + Words{"-o", file("b.etree"), "--cache", file("cache")}).err.find("from the cache"),
              std::string::npos);
}

TEST_F(CliOutputs, ALackOfSpaceIsToldBeforeTheWork) {
    RunOptions small;
    small.in_child = [] {
        const rlimit limit{1024, 1024};
        ::setrlimit(RLIMIT_FSIZE, &limit);
    };
    const std::string broken = file("broken.obj", "f 1 2 3\n");
    const Outcome o = run(bake(broken) + Words{"-o", file("a.etree")}, small);
    EXPECT_EQ(o.code, 4) << o.err;
    EXPECT_NE(o.err.find("ulimit -f"), std::string::npos) << o.err;
    EXPECT_EQ(listing(), Words{"broken.obj"});
}

TEST_F(CliOutputs, AClosedPipeForMessagesKillsNothing) {
    RunOptions closed;
    closed.in_child = [] {
        int ends[2];
        if (::pipe(ends) != 0) ::_exit(126);
        ::dup2(ends[1], 1);
        ::dup2(ends[1], 2);
        ::close(ends[0]);
        ::close(ends[1]);
    };
    const Outcome o = run(bake(mesh()) + Words{"-o", file("a.etree")}, closed);
    EXPECT_EQ(o.code, 0);
    EXPECT_EQ(run({"info", file("a.etree")}).code, 0);
}

// ---- ordinary errors ----

#ifdef PROLATE_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

TEST_F(CliOutputs, FoldersInPlaceOfFilesAreOrdinaryErrors) {
    const std::string m = mesh();
    fs::create_directory(folder_ / "folder.json");
    expect_failure(run({"bake", "--manifest", file("folder.json")}), 4, file("folder.json"), "directory");
    ASSERT_EQ(run(bake(m) + Words{"-o", file("a.etree"), "--cache", file("cache")}).code, 0);
    std::vector<fs::path> entries;
    for (const auto& entry : fs::directory_iterator(file("cache"))) entries.push_back(entry.path());
    for (const fs::path& entry : entries) {
        fs::remove(entry);
        fs::create_directory(entry);
    }
    const std::string manifest = file("assets.json", R"({"defaults": {"ellipsoids": 1, "quality": "fast"}, "assets": [
        {"mesh": "m.obj", "output": "b.etree"}, {"mesh": "m.obj", "output": "c.etree", "ellipsoids": 2}]})");
    const Outcome o = run({"bake", "--manifest", manifest, "--cache", file("cache")});
    EXPECT_EQ(o.code, 0) << o.err;
    EXPECT_EQ(read(file("b.etree")), read(file("a.etree")));
    bool kept = false;
    for (const auto& entry : fs::directory_iterator(file("cache")))
        kept |= entry.is_regular_file() && entry.path().extension() == ".etree";
    EXPECT_TRUE(kept) << "the cache goes on to serve the others";
}

TEST_F(CliOutputs, WithoutThreadsTheWorkIsDoneByOne) {
    if (kSanitized) GTEST_SKIP() << "sanitizers need memory and threads of their own";
    const std::string t = tree(), m = shared("peanut.obj");
    RunOptions alone;
    alone.in_child = refusing({SYS_clone, SYS_clone3}, EAGAIN);
    if (run({"--version"}, alone).code == 126) GTEST_SKIP() << "no seccomp here";
    EXPECT_EQ(run(bake(m) + Words{"-o", file("a.etree")}, alone).code, 0);
    EXPECT_EQ(run({"verify", t, m}, alone).code, 0);
    EXPECT_EQ(run({"render", t, m, "-o", file("a.png"), "--size", "400x300", "--samples", "16"}, alone).code, 0);
    EXPECT_EQ(run({"view", t, "-o", file("a.html")}, alone).code, 0);
}

TEST_F(CliOutputs, TooLittleMemoryIsNoFaultOfTheMesh) {
    if (kSanitized) GTEST_SKIP() << "sanitizers need memory and threads of their own";
    RunOptions small;
    small.in_child = [] {
        const rlimit limit{600u << 20, 600u << 20};
        ::setrlimit(RLIMIT_AS, &limit);
    };
    const std::string m = file("large.obj", obj_text(peanut(200)));
    const Outcome o = run({"bake", m, "-o", file("a.etree"), "--quality", "best"}, small);
    if (o.code == 0) GTEST_SKIP() << "it was enough memory";
    EXPECT_EQ(o.code, 4) << o.err;
    EXPECT_EQ(o.err.find("repair"), std::string::npos) << o.err;
}

TEST_F(CliOutputs, WithJsonErrorsAreJson) {
    const std::string t = tree();
    const struct {
        Words words;
        int code;
        std::string subject;
    } cases[] = {{{"info", file("none.etree"), "--json"}, 4, file("none.etree")},
                 {{"verify", t, file("none.obj"), "--json"}, 4, file("none.obj")},
                 {{"collide", t, t, "--json", "--pose", "1"}, 2, "--pose"},
                 {{"info", "--json"}, 2, "info"},
                 {{"bake", "--json", "--manifest", file("none.json")}, 4, file("none.json")},
                 {{"bake", file("none.obj"), "-o", file("a.etree"), "--json"}, 4, file("none.obj")},
                 {{"info", t, "--json", "--colour"}, 2, "--colour"}};
    for (const auto& c : cases) {
        const Outcome o = run(c.words);
        EXPECT_EQ(o.code, c.code) << o.err;
        const Json json = Json::parse(o.out, nullptr, false);
        ASSERT_TRUE(json.is_object() && json.contains("error")) << o.out;
        EXPECT_EQ(json["error"]["code"], c.code);
        EXPECT_EQ(json["error"]["subject"], c.subject);
        EXPECT_NE(json["error"]["what"], "");
        EXPECT_TRUE(o.err.starts_with("prolate: ")) << o.err;
    }
    EXPECT_EQ(run({"info", file("none.etree")}).out, "");
}

// ---- terminal and signals ----

TEST_F(CliOutputs, TheProgressLineFitsAndDumbTerminalsGetNone) {
    const std::string m = mesh(), name = std::string(100, 'p') + "\x1b[31m.obj";
    write(folder_ / name, read(m));
    const std::string manifest =
        file("assets.json",
             Json{{"assets", {{{"mesh", name}, {"output", "a.etree"}, {"levels", 1}, {"quality", "fast"}}}}}.dump());
    RunOptions terminal;
    terminal.terminal = true;
    for (const unsigned short width : std::initializer_list<unsigned short>{1, 12, 40}) {
        terminal.in_child = [width] {
            const winsize size{24, width, 0, 0};
            ::ioctl(2, TIOCSWINSZ, &size);
            ::setenv("TERM", "xterm", 1);
        };
        const Outcome narrow = run({"bake", "--manifest", manifest, "--json", "--rebake"}, terminal);
        EXPECT_EQ(narrow.code, 0);
        size_t drawn = 0;
        for (size_t at = 0; (at = narrow.err.find("\r\x1b[K", at)) != std::string::npos; at += 4) {
            const size_t end = std::min(narrow.err.find_first_of("\r\n", at + 4), narrow.err.size());
            const std::string line = narrow.err.substr(at + 4, end - at - 4);
            if (line.starts_with("prolate: ")) continue; // behind the wiped line
            EXPECT_LT(line.size(), width) << line;
            drawn += !line.empty();
        }
        EXPECT_EQ(drawn > 0, width > 1) << width;
        EXPECT_EQ(narrow.err.find("\x1b[31m"), std::string::npos) << "a name is no command to the terminal";
        EXPECT_NE(narrow.err.find("\\x1b[31m"), std::string::npos) << narrow.err;
    }

    terminal.in_child = [] { ::setenv("TERM", "dumb", 1); };
    const Outcome dumb = run(Words{"bake", m, "-o", file("b.etree"), "--levels", "1", "--quality", "fast"}, terminal);
    EXPECT_EQ(dumb.code, 0);
    EXPECT_EQ(dumb.err.find('\x1b'), std::string::npos) << dumb.err;
}

TEST_F(CliOutputs, ControlCharactersOfNamesStayOutOfMessages) {
    for (const char* name : {"a\nb", "a\x1b]0;title\x07", "a\x7f",
                             "a\xc2\x9b"
                             "31m",
                             "a\xe2\x80\xae"
                             "jbo",
                             "a\xff"}) {
        for (const Words& words : {Words{"info", file(name)}, Words{"bake", file(name), "-o", file("a.etree")}}) {
            const Outcome o = run(words);
            EXPECT_EQ(o.code, o.err.find("unknown kind") != std::string::npos ? 3 : 4) << o.err;
            EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
            for (const char* part : {"\x1b", "\x07", "\x7f", "\xc2\x9b", "\xe2\x80\xae", "\xff"})
                EXPECT_EQ(o.err.find(part), std::string::npos) << o.err;
            EXPECT_NE(o.err.find("\\x"), std::string::npos) << o.err;
        }
    }
    write(folder_ / "t\x1b[2J.etree", read(shared("peanut.etree")));
    EXPECT_EQ(run({"info", file("t\x1b[2J.etree")}).out.find('\x1b'), std::string::npos);
}

// A run that gets `number` as soon as it catches SIGTERM, or after so many milliseconds.
TEST_F(CliOutputs, SignalsEndTheWorkAndLeaveNothing) {
    const std::string large = file("large.obj", obj_text(peanut(60)));
    for (const int number : {SIGINT, SIGTERM, SIGHUP})
        for (const bool early : {false, true}) {
            SCOPED_TRACE(number);
            RunOptions options;
            options.signal = number;
            options.interrupt_after = std::chrono::milliseconds(early ? 0 : 300);
            const auto before = listing();
            const Outcome o =
                run({"bake", large, "-o", file("a.etree"), "--quality", "best", "--ellipsoids", "20000", "--json"},
                    options);
            EXPECT_EQ(o.code, 128 + number) << o.err;
            EXPECT_EQ(Json::parse(o.out)["error"]["code"], 128 + number);
            EXPECT_NE(o.err.find("interrupted; nothing was written"), std::string::npos) << o.err;
            EXPECT_EQ(listing(), before);
        }
    // Work that does not look is ended at once: here, a command that waits for its input.
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    RunOptions waits;
    waits.interrupt_after = std::chrono::milliseconds(50);
    waits.in_child = [&ends] { ::dup2(ends[0], 0); };
    for (const Words& words : {Words{"export", "-", "-o", file("a.csv")}, Words{"bake", "-", "-o", file("a.etree")},
                               Words{"bake", "--manifest", "-"}}) {
        const Outcome o = run(words, waits);
        EXPECT_EQ(o.code, 130) << o.err;
        EXPECT_EQ(o.err, "prolate: " + words[0] + ": interrupted; nothing was written\n");
        EXPECT_EQ(o.out, "");
    }
    const Outcome as_json = run({"info", "-", "--json"}, waits);
    EXPECT_EQ(as_json.out, R"({
  "error": {
    "code": 130,
    "subject": "info",
    "what": "interrupted",
    "advice": "nothing was written"
  }
}
)");
    const Outcome aside = run({"bake", "-", "-o", "-", "--json"}, waits);
    EXPECT_EQ(aside.out, "") << "standard output is for the tree";
    EXPECT_NE(aside.err.find("\"code\": 130"), std::string::npos) << aside.err;
    ::close(ends[0]);
    ::close(ends[1]);
}

TEST_F(CliOutputs, AnIgnoredSignalStaysIgnored) {
    RunOptions ignoring;
    const std::string out = file("a.etree"), begun = file("begun");
    ignoring.in_child = [&begun] {
        ::signal(SIGINT, SIG_IGN);
        ::close(::open(begun.c_str(), O_CREAT | O_WRONLY, 0600));
    };
    ignoring.interrupt_when = [&begun] { return fs::exists(begun); };
    EXPECT_EQ(run(bake(mesh()) + Words{"-o", out}, ignoring).code, 0);
    EXPECT_TRUE(fs::exists(out));
}

// ---- words ----

TEST_F(CliOutputs, NumbersAreNumbersAndNothingIsSwallowed) {
    const std::string t = tree(), m = mesh();
    const struct {
        Words words;
        std::string subject, says;
    } cases[] = {{bake(m) + Words{"-o", file("a.etree"), "--seed", "-1"}, "bake", "whole number"},
                 {bake(m) + Words{"-o", file("a.etree"), "--threads", ""}, "bake", "whole number"},
                 {bake(m) + Words{"-o", file("a.etree"), "--seed", "0x1"}, "bake", "whole number"},
                 {bake(m) + Words{"-o", file("a.etree"), "--alpha", ""}, "bake", "alpha"},
                 {bake(m) + Words{"-o", ""}, "bake", "empty"},
                 {bake(m) + Words{"-o", file("a.etree"), "--report", ""}, "bake", "empty"},
                 {{"collide", t, t, "--level", "99"}, "--level", "levels are 0 to 2"},
                 {{"collide", t, t, "--budget", "-1"}, "collide", "whole number"},
                 {{"verify", "-", "-"}, "standard input", ""},
                 {{"render", t, "-o", file("a.png"), "--view", "30"}, "--view", "30,18"},
                 {{"render", t, "-o", file("a.png"), "--view", "30,90"}, "--view", "30,18"},
                 {{"export", t, "-o", file("a.pov"), "--view", "30,18,4"}, "--view", "30,18"}};
    for (const auto& c : cases) {
        SCOPED_TRACE(c.words[0] + " " + c.words.back());
        const Outcome o = run(c.words);
        EXPECT_EQ(o.code, c.subject == "standard input" ? 3 : 2) << o.err;
        EXPECT_TRUE(o.err.starts_with("prolate: " + c.subject + ": ")) << o.err;
        EXPECT_NE(o.err.find(c.says), std::string::npos) << o.err;
    }
    EXPECT_EQ(run({"export", "--view", "30,18", t, "-o", file("a.pov")}).code, 0);
    EXPECT_EQ(run({"render", "--view", "30,18", t, "-o", file("a.png"), "--size", "400x300", "--samples", "16"}).code,
              0);
}

TEST_F(CliOutputs, AMeshThatIsNotTheTreesIsNamed) {
    const Outcome heat =
        run({"render", tree(), mesh(), "-o", file("a.png"), "--size", "400x300", "--samples", "16", "--heat"});
    EXPECT_EQ(heat.code, 0) << heat.err;
    EXPECT_NE(heat.err.find("not the mesh that"), std::string::npos) << heat.err;
    EXPECT_EQ(
        run({"render", tree(), shared("peanut.obj"), "-o", file("a.png"), "--size", "400x300", "--samples", "16"}).err,
        "");
}

TEST_F(CliOutputs, UnchangedFilesGetANewDate) {
    const std::string m = mesh(), out = file("a.etree");
    ASSERT_EQ(run(bake(m) + Words{"-o", out}).code, 0);
    fs::last_write_time(out, fs::file_time_type::clock::now() - std::chrono::hours(9));
    fs::last_write_time(m, fs::file_time_type::clock::now() - std::chrono::hours(5));
    EXPECT_NE(run(bake(m) + Words{"-o", out}).err.find("unchanged"), std::string::npos);
    EXPECT_GT(fs::last_write_time(out), fs::last_write_time(m)) << "make would bake it again and again";
}

TEST_F(CliOutputs, CollideTellsTheDistanceAndByItsExitCodeTheVerdict) {
    const std::string t = tree();
    const Json apart = Json::parse(run({"collide", t, t, "--pose", "0,0,-9", "--json"}).out);
    EXPECT_EQ(apart["verdict"], "separated");
    const double lower = apart["distance"]["lower"], upper = apart["distance"]["upper"];
    EXPECT_GT(lower, 6);
    EXPECT_LE(lower, upper);
    EXPECT_NEAR(lower, upper, 1e-4 * upper);
    const auto a = apart["distance"]["point_a"].get<std::vector<double>>(),
               b = apart["distance"]["point_b"].get<std::vector<double>>();
    EXPECT_NEAR(std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), upper, 1e-5 * upper);
    EXPECT_NE(run({"collide", t, t, "--pose", "0,0,-9"}).out.find("\ndistance "), std::string::npos);
    EXPECT_NE(run({"collide", t, t}).out.find("(level "), std::string::npos);
    EXPECT_EQ(run({"collide", t, t, "--pose", "0,0,-9", "--exit-code"}).code, 0);
    EXPECT_EQ(run({"collide", t, t, "--exit-code", "--json"}).code, 1);
    EXPECT_EQ(run({"collide", t, t, "--exit-code", "--budget", "0"}).code, 6);
    EXPECT_EQ(run({"collide", t, t}).code, 0);
}

TEST_F(CliOutputs, InputsComeFromStandardInput) {
    const auto from = [](const std::string& path) {
        RunOptions options;
        options.in_child = [path] { ::dup2(::open(path.c_str(), O_RDONLY), 0); };
        return options;
    };
    const std::string t = tree(), m = mesh();
    EXPECT_EQ(run({"info", "-", "--json"}, from(t)).out, run({"info", t, "--json"}).out);
    EXPECT_EQ(run({"export", "-", "-o", "-", "--format", "csv"}, from(t)).out,
              run({"export", t, "-o", "-", "--format", "csv"}).out);
    ASSERT_EQ(run(bake(m) + Words{"-o", file("a.etree")}).code, 0);
    EXPECT_EQ(run(bake("-") + Words{"-o", "-"}, from(m)).out, read(file("a.etree")));
    EXPECT_EQ(run({"verify", file("a.etree"), "-"}, from(m)).code, 0);
    // The kind of mesh is known by its content.
    ASSERT_EQ(run({"export", t, "-o", file("e.ply"), "--level", "0", "--segments", "4"}).code, 0);
    EXPECT_EQ(run(bake("-") + Words{"-o", file("b.etree")}, from(file("e.ply"))).code, 0);
    // An input is not overwritten through its pipe's name either.
    EXPECT_EQ(run({"export", "-", "-o", t, "--format", "csv", "--force"}, from(t)).code, 2);
    const std::string manifest = R"({"assets": [{"mesh": ")" + m + R"(", "output": ")" + file("c.etree") +
                                 R"(", "ellipsoids": 1, "quality": "fast"}]})";
    EXPECT_EQ(run({"bake", "--manifest", "-"}, from(file("assets.json", manifest))).code, 0);
}

TEST_F(CliOutputs, QuietRunsSayNothing) {
    const std::string m = mesh();
    const Outcome o = run(bake(m) + Words{"-o", file("a.etree"), "-q", "-j", "1"});
    EXPECT_EQ(o.code, 0);
    EXPECT_EQ(o.out + o.err, "");
    EXPECT_EQ(run(bake(m) + Words{"-o", file("a.etree"), "--quiet"}).err, "");
    EXPECT_NE(run({"info", file("none.etree"), "-q"}).err, "") << "errors are told";
    EXPECT_NE(run({"info", file("a.etree"), "-q"}).out, "") << "so are answers";
}

TEST_F(CliOutputs, TheCommandDescribesItself) {
    EXPECT_EQ(run({"help", "bake"}).out, run({"bake", "--help"}).out);
    EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
    expect_failure(run({"help", "bkae"}), 2, "bkae", "did you mean 'bake'?");
    const std::string man = run({"man"}).out;
    EXPECT_TRUE(man.starts_with(".TH PROLATE 1"));
    for (const char* word : {".SH NAME", "PROLATE BAKE", "\\-\\-ellipsoids", "PROLATE COLLIDE", "Exit codes"})
        EXPECT_NE(man.find(word), std::string::npos) << word;
    for (const char* shell : {"bash", "zsh", "fish"}) {
        const std::string script = run({"completion", shell}).out;
        for (const char* word : {"collide", "ellipsoids", "exit-code", "beside"})
            EXPECT_NE(script.find(word), std::string::npos) << shell << " " << word;
        const std::string path = file(shell, script);
        const std::string check = std::string(shell) + " -n " + path;
        if (std::system(("command -v " + std::string(shell) + " >/dev/null").c_str()) == 0) {
            EXPECT_EQ(std::system(check.c_str()), 0) << shell;
        }
    }
    // What bash makes of it.
    const std::string bash = "bash -c 'source " + file("bash") +
                             "; COMP_WORDS=(prolate bake --ell); COMP_CWORD=2; _prolate; [[ $COMPREPLY == "
                             "--ellipsoids ]] && COMP_WORDS=(prolate ver); COMP_CWORD=1; _prolate; [[ $COMPREPLY == "
                             "verify ]] && COMP_WORDS=(prolate render --up -); COMP_CWORD=3; _prolate; [[ "
                             "${COMPREPLY[*]} == \"-x -y -z\" ]]'";
    EXPECT_EQ(std::system(bash.c_str()), 0);
    for (const char* command : {"bake", "info", "verify", "export", "collide", "render", "view", "completion", "man"})
        EXPECT_NE(run({"help", command}).out.find("Examples:"), std::string::npos) << command;
}

} // namespace
} // namespace prolate
