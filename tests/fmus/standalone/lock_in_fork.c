/* Forks while it has the lock on the list of shared processes; ends with 0 if the child can have it, too. */
#include "process_shared.c"

#include <sys/wait.h>

int main(void) {
    int status = 0;
    lock();
    pid_t child = fork();
    if (child == 0) {
        alarm(1);
        lock();
        unlock();
        _exit(0);
    }
    return waitpid(child, &status, 0) == child && WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}
