// Reading and atomic writing of whole files (POSIX).
#include "src/can_save.hpp"

#include <prolate/tree.hpp>

#include <cerrno>
#include <cstdlib>
#include <string>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace prolate {
namespace {

Error io(const char* what) {
    return {ErrorCode::io, what, static_cast<uint64_t>(errno)};
}

// With its last slash, or empty.
std::string folder_of(const std::string& path) {
    return path.substr(0, path.rfind('/') + 1);
}

class Descriptor {
public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    explicit operator bool() const { return fd_ >= 0; }
    int get() const { return fd_; }
    // Delayed write errors may surface only here.
    bool close() { return ::close(std::exchange(fd_, -1)) == 0; }

private:
    int fd_;
};

// The file behind a path: where symbolic links lead, whether or not a file is there yet.
std::string resolved(const char* given) {
    std::string path = given;
    for (int links = 0; links < 40; ++links) { // as many as Linux follows
        char target[4096];
        const ssize_t length = ::readlink(path.c_str(), target, sizeof target);
        if (length <= 0 || length == static_cast<ssize_t>(sizeof target)) break; // no link
        const std::string_view next(target, static_cast<size_t>(length));
        path = next.starts_with('/') ? std::string(next) : folder_of(path).append(next);
    }
    return path;
}

// A new, empty file beside `path` that is to take its name; with its own name in `name`.
int create_temporary(const std::string& path, std::string& name) {
    constexpr size_t kKept = 200; // bytes of the name, so that the ending fits into the 255 of most file systems
    const std::string folder = folder_of(path);
    name = folder + path.substr(folder.size(), kKept) + ".tmp-XXXXXX";
    return ::mkostemp(name.data(), O_CLOEXEC);
}

bool write_all(int fd, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return false;
        bytes = bytes.subspan(static_cast<size_t>(n));
    }
    return true;
}

} // namespace

Result<Tree> Tree::open(std::vector<std::byte> bytes, const OpenOptions& options) {
    auto view = TreeView::open(bytes, options);
    if (!view) return view.error();
    return Tree(std::move(bytes), *view);
}

Result<Tree> load(const char* path) {
    const Descriptor file(::open(path, O_RDONLY | O_CLOEXEC));
    if (!file) return io("cannot open the file");
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) return io("cannot read the file");
    if (S_ISDIR(status.st_mode)) {
        errno = EISDIR;
        return io("cannot read the file");
    }
    std::vector<std::byte> bytes;
    if (status.st_size > 0) bytes.reserve(static_cast<size_t>(status.st_size));
    std::byte buffer[1 << 16];
    for (;;) {
        const ssize_t n = ::read(file.get(), buffer, sizeof buffer);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io("cannot read the file");
        if (n == 0) break;
        bytes.insert(bytes.end(), buffer, buffer + n);
    }
    return Tree::open(std::move(bytes));
}

Result<void> can_save(const char* given_path) {
    const std::string path = resolved(given_path);
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0) {
        if (S_ISDIR(status.st_mode)) return Error{ErrorCode::io, "cannot write there", EISDIR};
        if (!S_ISREG(status.st_mode)) {
            if (::access(path.c_str(), W_OK) != 0) return io("cannot write there");
            return {};
        }
        // In a sticky folder only its owner, the file's owner, and root may replace a file.
        struct stat folder {};
        const uid_t user = ::geteuid();
        if (::stat((folder_of(path) + ".").c_str(), &folder) == 0 && (folder.st_mode & S_ISVTX) != 0 && user != 0 &&
            user != folder.st_uid && user != status.st_uid)
            return Error{ErrorCode::io, "cannot replace another user's file in its folder", EPERM};
    } else if (errno != ENOENT) {
        return io("cannot write there");
    }
    // The rest only a trial tells: permissions, file systems that are read-only, full or of another mind.
    std::string temporary;
    const Descriptor trial(create_temporary(path, temporary));
    if (!trial) return io("cannot create a file there");
    ::unlink(temporary.c_str());
    // A file that is replaced stays until the new one is whole, so there must be room for both.
    const int error = ::posix_fallocate(trial.get(), 0, 4096);
    if (error == ENOSPC || error == EDQUOT || error == EFBIG)
        return Error{ErrorCode::io, "there is no room for a file", static_cast<uint64_t>(error)};
    return {};
}

Result<void> save(const char* given_path, std::span<const std::byte> bytes) {
    // Behind a symbolic link, its target is replaced and the link kept.
    const std::string path = resolved(given_path);
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) { // a pipe or device: nothing to replace
        Descriptor device(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
        if (!device) return io("cannot open the output");
        if (!write_all(device.get(), bytes) || !device.close()) return io("cannot write the output");
        return {};
    }
    std::string temporary;
    Descriptor file(create_temporary(path, temporary));
    if (!file) return io("cannot create a file there");
    const auto give_up = [&](const char* what) {
        const Error error = io(what);
        ::unlink(temporary.c_str());
        return error;
    };
    // mkostemp creates with mode 0600; a new file gets what the umask leaves of 0666, a replaced one keeps its mode.
    mode_t mode = status.st_mode & 07777;
    if (mode == 0) {
        const mode_t mask = ::umask(0);
        ::umask(mask);
        mode = 0666 & ~mask;
    }
    // A file system that refuses has modes of its own, or the file stays private: no reason to lose the content.
    static_cast<void>(::fchmod(file.get(), mode));
    if (!write_all(file.get(), bytes) || ::fsync(file.get()) != 0 || !file.close())
        return give_up("cannot write the file");
    if (::rename(temporary.c_str(), path.c_str()) != 0) return give_up("cannot move the file to its name");
    // Make the new name durable; a file system that cannot is no reason to fail.
    const std::string folder = folder_of(path) + ".";
    if (const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)); directory)
        ::fsync(directory.get());
    return {};
}

} // namespace prolate
