// The prolate command for tests that run it: small meshes, the command in a child process, a folder for each test.
#pragma once

#include <prolate/mesh.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace prolate {

namespace fs = std::filesystem;

// ---- meshes ----

// The unit cube's surface, each side cut into n x n squares, its points then moved by `shape`.
inline Mesh box_mesh(uint32_t n, const std::function<Vec3(double, double, double)>& shape) {
    Mesh soup;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side)
            for (uint32_t i = 0; i < n; ++i)
                for (uint32_t j = 0; j < n; ++j) {
                    const auto base = static_cast<uint32_t>(soup.vertices.size());
                    for (const auto& [u, v] : {std::pair{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}) {
                        double p[3];
                        p[axis] = 2.0 * side - 1;
                        p[(axis + 1) % 3] = 2.0 * u / n - 1;
                        p[(axis + 2) % 3] = 2.0 * v / n - 1;
                        soup.vertices.push_back(shape(p[0], p[1], p[2]));
                    }
                    Triangle a{base, base + 1, base + 2}, b{base, base + 2, base + 3};
                    if (side == 0) std::swap(a[1], a[2]), std::swap(b[1], b[2]);
                    soup.triangles.insert(soup.triangles.end(), {a, b});
                }
    return soup;
}
inline Mesh cube(float size = 1) {
    return box_mesh(1, [size](double x, double y, double z) {
        return Vec3{size * static_cast<float>(x), size * static_cast<float>(y), size * static_cast<float>(z)};
    });
}
// A bent, waisted body: nothing that one ellipsoid fits well.
inline Mesh peanut(uint32_t n) {
    return box_mesh(n, [](double x, double y, double z) {
        const double length = std::hypot(x, y, z), waist = 0.5 + 0.5 * x * x;
        return Vec3{static_cast<float>(2 * x / length), static_cast<float>(waist * y / length + 0.3 * x * x),
                    static_cast<float>(waist * z / length)};
    });
}

inline std::string obj_text(const Mesh& mesh) {
    std::ostringstream out;
    out.precision(9);
    for (const Vec3& v : mesh.vertices) out << "v " << v.x << ' ' << v.y << ' ' << v.z << '\n';
    for (const Triangle& t : mesh.triangles) out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
    return out.str();
}

// ---- running the command ----

inline std::string read(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}
inline void write(const fs::path& path, std::string_view content) {
    std::ofstream(path, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
}

struct Outcome {
    int code = -1; // exit code, or minus the signal
    std::string out, err;
};

struct RunOptions {
    std::string stdout_path;                                       // instead of a file that is read back
    std::function<void()> in_child = [] {};                        // after fork; only async-signal-safe calls
    std::optional<std::chrono::milliseconds> interrupt_after = {}; // Ctrl-C so long after the program first catches it
    std::function<bool()> interrupt_when = {};                     // Ctrl-C as soon as this holds
    bool terminal = false;                                         // stderr is one
    int signal = SIGINT;                                           // what "Ctrl-C" above sends
};

// Does the process catch SIGINT yet?
inline bool catches_interrupt(pid_t pid) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("SigCgt:")) return (std::stoull(line.substr(7), nullptr, 16) & (1u << (SIGINT - 1))) != 0;
    return false;
}

// The master's side of a new pseudo-terminal.
inline int open_terminal() {
    const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    EXPECT_TRUE(terminal >= 0 && ::grantpt(terminal) == 0 && ::unlockpt(terminal) == 0);
    return terminal;
}

class Cli : public ::testing::Test {
protected:
    // One bake for all tests that only need some tree.
    static void SetUpTestSuite() {
        ::unsetenv("PROLATE_CACHE");
        std::string name = (fs::temp_directory_path() / "prolate-cli-XXXXXX").string();
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        shared_ = name;
        write(shared_ / "peanut.obj", obj_text(peanut(8)));
        const Outcome baked = run({"bake", shared("peanut.obj"), "-o", shared("peanut.etree"), "--levels", "2",
                                   "--degree", "4", "--quality", "fast", "--report", shared("report.json")});
        ASSERT_EQ(baked.code, 0) << baked.err;
        baked_out_ = baked.out;
        baked_err_ = baked.err;
    }
    static void TearDownTestSuite() { fs::remove_all(shared_); }
    void SetUp() override {
        folder_ = shared_ / ::testing::UnitTest::GetInstance()->current_test_info()->name();
        fs::create_directory(folder_);
    }

    static std::string shared(const std::string& name) { return (shared_ / name).string(); }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    std::string file(const std::string& name, std::string_view content) const {
        write(folder_ / name, content);
        return file(name);
    }
    std::vector<std::string> listing() const {
        std::vector<std::string> names;
        for (const auto& entry : fs::directory_iterator(folder_)) names.push_back(entry.path().filename());
        std::sort(names.begin(), names.end());
        return names;
    }

    static Outcome run(const std::vector<std::string>& arguments, const RunOptions& options = {}) {
        const std::string out = shared(".stdout"), err = shared(".stderr");
        std::vector<char*> argv{const_cast<char*>(PROLATE_COMMAND)};
        for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
        argv.push_back(nullptr);
        const std::string& target = options.stdout_path.empty() ? out : options.stdout_path;
        const int terminal = options.terminal ? open_terminal() : -1;
        const pid_t pid = ::fork();
        if (pid == 0) {
            ::dup2(::open(target.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), 1);
            const char* const to = options.terminal ? ::ptsname(terminal) : err.c_str();
            ::dup2(::open(to, O_WRONLY | O_CREAT | O_TRUNC | O_NOCTTY, 0600), 2);
            options.in_child();
            ::execv(PROLATE_COMMAND, argv.data());
            ::_exit(127);
        }
        int status = 0;
        if (options.interrupt_after) {
            while (!catches_interrupt(pid) && ::waitpid(pid, &status, WNOHANG) == 0) std::this_thread::yield();
            std::this_thread::sleep_for(*options.interrupt_after);
            ::kill(pid, options.signal);
        }
        if (options.interrupt_when) {
            while (!options.interrupt_when() && ::waitpid(pid, &status, WNOHANG) == 0) std::this_thread::yield();
            ::kill(pid, options.signal);
        }
        if (options.terminal) { // it holds little, and would block the program when full
            std::ofstream copy(err, std::ios::binary);
            char buffer[4096];
            for (ssize_t n; (n = ::read(terminal, buffer, sizeof buffer)) > 0;) copy.write(buffer, n);
            ::close(terminal);
        }
        ::waitpid(pid, &status, 0);
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status),
                options.stdout_path.empty() ? read(out) : "", read(err)};
    }

    // Fails with `code` and the one line "prolate: <subject>: <...words...>; <advice>".
    static void expect_failure(const Outcome& o, int code, const std::string& subject, const std::string& words) {
        EXPECT_EQ(o.code, code) << o.err;
        EXPECT_EQ(o.out, "");
        EXPECT_TRUE(o.err.starts_with("prolate: " + subject + ": ")) << o.err;
        EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
        EXPECT_NE(o.err.find(words), std::string::npos) << o.err;
        EXPECT_NE(o.err.find("; "), std::string::npos) << "says what to do: " << o.err;
    }
    // Baking the file `mesh` fails so, and leaves nothing but it.
    void expect_bake_fails(const std::string& mesh, int code, const std::string& words) {
        SCOPED_TRACE(mesh);
        const auto before = listing();
        expect_failure(run({"bake", mesh, "-o", file("out.etree"), "--report", file("report.json")}), code, mesh,
                       words);
        EXPECT_EQ(listing(), before);
    }

    static inline fs::path shared_;
    static inline std::string baked_out_, baked_err_;
    fs::path folder_;
};

} // namespace prolate
